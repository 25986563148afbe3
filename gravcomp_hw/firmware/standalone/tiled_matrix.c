#include "tiled_matrix.h"

#include "../core/maths.h"
#include "model.h"

// Copy a matrix by tiles to its lower triangle row by row.
static void by_rows(const float *matrix, uint32_t r, float *rows) {
  for (uint32_t i = 0; i < r; i += GC_TILE) {
    for (uint32_t j = 0; j < i; ++j) {
      for (uint32_t a = 0; a < GC_TILE; ++a) {
        rows[(i + a) * (i + a + 1u) / 2u + j] = *matrix++;
      }
    }
    for (uint32_t a = 0; a < GC_TILE; ++a) {
      for (uint32_t c = 0; c <= a; ++c) {
        rows[(i + a) * (i + a + 1u) / 2u + i + c] = *matrix++;
      }
    }
  }
}

// Subtract the products with row j of the factor from column j of four rows: entry -= row[k] other[k] for k < j.
static void reduce(float *const *rows, const float *restrict other, uint32_t j) {
  const float *restrict a = rows[0], *restrict b = rows[1], *restrict c = rows[2], *restrict d = rows[3];
  float x = rows[0][j], y = rows[1][j], z = rows[2][j], w = rows[3][j];
  for (uint32_t k = 0; k < j; ++k) {
    const float l = other[k];
    x -= a[k] * l;
    y -= b[k] * l;
    z -= c[k] * l;
    w -= d[k] * l;
  }
  rows[0][j] = x, rows[1][j] = y, rows[2][j] = z, rows[3][j] = w;
}

bool gc_factorise(const float *matrix, uint32_t r, float *factor) {
  by_rows(matrix, r, factor);
  for (uint32_t i = 0; i < r; i += GC_TILE) {
    float *rows[GC_TILE];
    for (uint32_t a = 0; a < GC_TILE; ++a) {
      rows[a] = factor + (i + a) * (i + a + 1u) / 2u;
    }
    for (uint32_t j = 0; j < i; ++j) {
      const float *other = factor + j * (j + 1u) / 2u;
      reduce(rows, other, j);
      for (uint32_t a = 0; a < GC_TILE; ++a) {
        rows[a][j] *= other[j];
      }
    }
    for (uint32_t a = 0; a < GC_TILE; ++a) {
      for (uint32_t c = 0; c <= a; ++c) {
        float left = rows[a][i + c];
        for (uint32_t k = 0; k < i + c; ++k) {
          left -= rows[a][k] * rows[c][k];
        }
        if (a == c && !(left > 0.0f)) {  // also for NaN
          return false;
        }
        rows[a][i + c] = a == c ? 1.0f / gc_sqrt(left) : left * rows[c][i + c];
      }
    }
  }
  return true;
}

void gc_solve(const float *factor, uint32_t r, float (*columns)[GC_COLUMNS]) {
  for (uint32_t i = 0; i < r; ++i) {
    const float *row = factor + i * (i + 1u) / 2u;
    float x = columns[i][0], y = columns[i][1], z = columns[i][2], w = columns[i][3];
    for (uint32_t j = 0; j < i; ++j) {
      const float l = row[j];
      x -= l * columns[j][0], y -= l * columns[j][1], z -= l * columns[j][2], w -= l * columns[j][3];
    }
    const float inverse = row[i];
    columns[i][0] = x * inverse, columns[i][1] = y * inverse, columns[i][2] = z * inverse, columns[i][3] = w * inverse;
  }
  for (uint32_t i = r; i-- > 0u;) {
    const float *entry = factor + i * (i + 1u) / 2u + i;
    const float inverse = *entry;
    float x = columns[i][0], y = columns[i][1], z = columns[i][2], w = columns[i][3];
    for (uint32_t k = i + 1u; k < r; ++k) {
      entry += k;
      const float l = *entry;
      x -= l * columns[k][0], y -= l * columns[k][1], z -= l * columns[k][2], w -= l * columns[k][3];
    }
    columns[i][0] = x * inverse, columns[i][1] = y * inverse, columns[i][2] = z * inverse, columns[i][3] = w * inverse;
  }
}
