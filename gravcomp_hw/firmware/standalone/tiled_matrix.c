#include "tiled_matrix.h"

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

// Return x . y of n numbers, in four partial sums.
static float dot(const float *restrict x, const float *restrict y, uint32_t n) {
  float s_0 = 0.0f, s_1 = 0.0f, s_2 = 0.0f, s_3 = 0.0f;
  uint32_t i = 0;
  for (; i + 4u <= n; i += 4u) {
    s_0 += x[i] * y[i];
    s_1 += x[i + 1u] * y[i + 1u];
    s_2 += x[i + 2u] * y[i + 2u];
    s_3 += x[i + 3u] * y[i + 3u];
  }
  for (; i < n; ++i) {
    s_0 += x[i] * y[i];
  }
  return (s_0 + s_1) + (s_2 + s_3);
}

bool gc_factorise(const float *matrix, uint32_t r, float *factor) {
  by_rows(matrix, r, factor);
  for (uint32_t i = 0; i < r; ++i) {
    float *row = factor + i * (i + 1u) / 2u;
    for (uint32_t j = 0; j < i; ++j) {
      const float *other = factor + j * (j + 1u) / 2u;
      row[j] = (row[j] - dot(row, other, j)) * other[j];
    }
    const float pivot = row[i] - dot(row, row, i);
    if (!(pivot > 0.0f)) { // also for NaN
      return false;
    }
    row[i] = 1.0f / __builtin_sqrtf(pivot);
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
