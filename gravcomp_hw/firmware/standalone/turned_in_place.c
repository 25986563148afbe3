#include "turned_in_place.h"

#include "../core/maths.h"

#define GC_SEPARATE 1e-3f      // delta: cables that turn the tip in place by less than a thirtieth do not count
#define GC_LEAST_SHORTENING 1e-5f  // of the square of the tip's motion
#define GC_REGULAR 1e-7f       // of the trace: what makes the inverse exist
#define GC_POWER_STEPS 24u     // of the power iteration, whose estimate enters only times GC_SEPARATE

typedef float matrix3[3][3];

// Return a b^T of rows (3, m).
static void product(uint32_t m, const float (*a)[GC_CABLES_MAX], const float (*b)[GC_CABLES_MAX], matrix3 to) {
  for (uint32_t i = 0; i < 3u; ++i) {
    for (uint32_t j = 0; j < 3u; ++j) {
      float sum = 0.0f;
      for (uint32_t k = 0; k < m; ++k) {
        sum += a[i][k] * b[j][k];
      }
      to[i][j] = sum;
    }
  }
}

// Write the inverse of a symmetric matrix by its cofactors. Returns false where it is singular.
static bool inverse(matrix3 of, matrix3 to) {
  for (uint32_t i = 0; i < 3u; ++i) {
    for (uint32_t j = 0; j < 3u; ++j) {
      const uint32_t a = (i + 1u) % 3u, b = (i + 2u) % 3u, c = (j + 1u) % 3u, d = (j + 2u) % 3u;
      to[j][i] = of[a][c] * of[b][d] - of[a][d] * of[b][c];
    }
  }
  const float determinant = (of[0][0] * to[0][0] + of[0][1] * to[1][0]) + of[0][2] * to[2][0];
  if (!(determinant > 0.0f)) {
    return false;
  }
  const float scale = 1.0f / determinant;
  for (uint32_t i = 0; i < 3u; ++i) {
    for (uint32_t j = 0; j < 3u; ++j) {
      to[i][j] *= scale;
    }
  }
  return true;
}

// Return the largest eigenvalue of a symmetric matrix.
static float largest_eigenvalue(matrix3 of) {
  float v[3] = {1.0f, 0.7f, 0.4f}, value = 0.0f;
  for (uint32_t step = 0; step < GC_POWER_STEPS; ++step) {
    float next[3], squared = 0.0f;
    for (uint32_t i = 0; i < 3u; ++i) {
      next[i] = (of[i][0] * v[0] + of[i][1] * v[1]) + of[i][2] * v[2];
      squared += next[i] * next[i];
    }
    const float length = gc_sqrt(squared);
    if (!(length > 0.0f)) {
      return 0.0f;
    }
    value = length;
    for (uint32_t i = 0; i < 3u; ++i) {
      v[i] = next[i] / length;
    }
  }
  return value;
}

// Replace the vector (x, y, z) by D times it.
static void apply(matrix3 d, float *x, float *y, float *z) {
  const float a = *x, b = *y, c = *z;
  *x = (d[0][0] * a + d[0][1] * b) + d[0][2] * c;
  *y = (d[1][0] * a + d[1][1] * b) + d[1][2] * c;
  *z = (d[2][0] * a + d[2][1] * b) + d[2][2] * c;
}

void gc_keep_turned_in_place(const gc_shape *shape, uint32_t m, const float *axis, float (*rows)[GC_CABLES_MAX], float *offset) {
  float moved_by[3][GC_CABLES_MAX], turn[3][GC_CABLES_MAX];
  for (uint32_t k = 0; k < m; ++k) {
    const float root = 1.0f / gc_sqrt(shape->compliance[k][k]);
    float along = -shape->lengthening[k];
    for (uint32_t i = 0; i < 3u; ++i) {
      along += axis[i] * shape->effector_compliance[i][k];
    }
    for (uint32_t i = 0; i < 3u; ++i) {
      moved_by[i][k] = root * (shape->effector_compliance[i][k] - along * axis[i]);
      turn[i][k] = root * shape->effector_compliance[3u + i][k];
    }
  }
  matrix3 moved, inverted, both, whole, d;
  product(m, moved_by, moved_by, moved);
  const float size = (moved[0][0] + moved[1][1]) + moved[2][2];
  if (!(size > 0.0f)) {
    return;
  }
  for (uint32_t i = 0; i < 3u; ++i) {
    for (uint32_t j = 0; j < 3u; ++j) {
      moved[i][j] += GC_LEAST_SHORTENING * size * axis[i] * axis[j];
      moved[i][j] /= size;  // of order one: the products of the inverse neither overflow nor vanish
    }
    moved[i][i] += GC_REGULAR;
  }
  product(m, turn, moved_by, both);
  product(m, turn, turn, whole);
  const float largest = largest_eigenvalue(whole);
  matrix3 alone, sum;
  bool possible = largest > 0.0f && inverse(moved, inverted);
  for (uint32_t i = 0; possible && i < 3u; ++i) {
    float row[3];
    for (uint32_t j = 0; j < 3u; ++j) {
      row[j] = ((both[i][0] * inverted[0][j] + both[i][1] * inverted[1][j]) + both[i][2] * inverted[2][j]) / size;
    }
    for (uint32_t j = 0; j < 3u; ++j) {
      alone[i][j] = (whole[i][j] - ((row[0] * both[j][0] + row[1] * both[j][1]) + row[2] * both[j][2])) / largest;
      sum[i][j] = alone[i][j] + (i == j ? GC_SEPARATE : 0.0f);
    }
  }
  possible = possible && inverse(sum, inverted);
  for (uint32_t i = 0; i < 3u; ++i) {
    for (uint32_t j = 0; j < 3u; ++j) {
      d[i][j] = possible ? (alone[i][0] * inverted[0][j] + alone[i][1] * inverted[1][j]) + alone[i][2] * inverted[2][j] : 0.0f;
    }
  }
  for (uint32_t k = 0; k < m; ++k) {
    apply(d, &rows[0][k], &rows[1][k], &rows[2][k]);
  }
  apply(d, &offset[0], &offset[1], &offset[2]);
}
