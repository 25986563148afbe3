#include "law_of_invariants.h"

#include <stddef.h>

#include "../core/maths.h"

// J^(-1/3) by Newton's method; from 0.5 to 2 five steps leave rounding errors.
static float inverse_root(float j) {
  float x = 1.0f;
  for (uint32_t k = 0; k < 5u; ++k) {
    x = x * (4.0f - ((j * x) * x) * x) * (1.0f / 3.0f);
  }
  return x;
}

// Row and column of each component.
static const uint8_t ROW[6] = {0, 1, 2, 0, 1, 0}, COLUMN[6] = {0, 1, 2, 1, 2, 2};

void gc_law_deviating_stress(const gc_law *law, const float e[6], float t[6], float (*d)[6]) {
  const float bulk = law->first + 2.0f / 3.0f * law->shear;
  const float c[6] = {2.0f * e[0] + 1.0f, 2.0f * e[1] + 1.0f, 2.0f * e[2] + 1.0f, e[3], e[4], e[5]};
  float ci[6] = {c[1] * c[2] - c[4] * c[4], c[0] * c[2] - c[5] * c[5], c[0] * c[1] - c[3] * c[3],
                 c[4] * c[5] - c[3] * c[2], c[3] * c[5] - c[0] * c[4], c[3] * c[4] - c[1] * c[5]};
  // det C - 1 from the invariants of 2 E: without the difference of large numbers, which a large kappa would show.
  const float u[3] = {2.0f * e[0], 2.0f * e[1], 2.0f * e[2]};
  const float trace = (u[0] + u[1]) + u[2];
  const float minors = ((u[0] * u[1] - e[3] * e[3]) + (u[1] * u[2] - e[4] * e[4])) + (u[2] * u[0] - e[5] * e[5]);
  const float det = (u[0] * (u[1] * u[2] - e[4] * e[4]) - e[3] * (e[3] * u[2] - e[4] * e[5])) +
                    e[5] * (e[3] * e[4] - u[1] * e[5]);
  const float grown = (trace + minors) + det;
  const float j = gc_sqrt(gc_max(1.0f + grown, 0.125f)), swelling = grown / (1.0f + j);
  const float inverse = 1.0f / gc_max(1.0f + grown, 0.125f);
  for (uint32_t k = 0; k < 6u; ++k) {
    ci[k] *= inverse;
  }
  const float third = inverse_root(gc_clamp(j, 0.5f, 2.0f)), root = third * third;
  const float first = (c[0] + c[1]) + c[2];
  const float second = (((c[0] * c[1] + c[1] * c[2]) + c[2] * c[0]) - (c[3] * c[3] + c[4] * c[4])) - c[5] * c[5];
  const float x = root * first - 3.0f;
  const float w1 = law->c10 + x * (2.0f * law->c20 + 3.0f * law->c30 * x), w11 = 2.0f * law->c20 + 6.0f * law->c30 * x;
  const float g = 2.0f * w1 * root, h = 2.0f * law->c01 * root * root;
  const float pressure = bulk * j * swelling, linear = 0.5f * law->first * trace;
  float unit[6], a[6], shape[6];
  for (uint32_t k = 0; k < 6u; ++k) {
    unit[k] = k < 3u ? 1.0f : 0.0f;
    a[k] = root * (unit[k] - first * (1.0f / 3.0f) * ci[k]);
    shape[k] = first * unit[k] - c[k];
    const float whole = (2.0f * w1 * a[k] + h * (shape[k] - 2.0f / 3.0f * second * ci[k])) + pressure * ci[k];
    t[k] = whole - (k < 3u ? linear + 2.0f * law->shear * e[k] : law->shear * e[k]);
  }
  if (d == NULL) {
    return;
  }
  const float full[3][3] = {{ci[0], ci[3], ci[5]}, {ci[3], ci[1], ci[4]}, {ci[5], ci[4], ci[2]}};
  const float outer = (2.0f / 9.0f * g * first + 8.0f / 9.0f * h * second) + bulk * j * (2.0f * j - 1.0f);
  const float product = (2.0f / 3.0f * g * first + 4.0f / 3.0f * h * second) - 2.0f * pressure;
  for (uint32_t m = 0; m < 6u; ++m) {
    const uint32_t mi = ROW[m], mj = COLUMN[m];
    for (uint32_t n = 0; n <= m; ++n) {
      const uint32_t ni = ROW[n], nj = COLUMN[n];
      const float mixed = full[mi][ni] * full[mj][nj] + full[mi][nj] * full[mj][ni];
      float value = (outer * ci[m] * ci[n] + 0.5f * product * mixed) + 4.0f * w11 * a[m] * a[n];
      value -= 2.0f / 3.0f * g * (unit[m] * ci[n] + unit[n] * ci[m]);
      value += h * (2.0f * unit[m] * unit[n] - 4.0f / 3.0f * (shape[m] * ci[n] + shape[n] * ci[m]));
      value -= law->first * unit[m] * unit[n];
      if (m == n) {
        value -= m < 3u ? 2.0f * h + 2.0f * law->shear : h + law->shear;
      }
      d[m][n] = d[n][m] = value;
    }
  }
}
