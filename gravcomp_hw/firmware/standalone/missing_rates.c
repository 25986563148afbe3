#include "missing_rates.h"

#include "../core/maths.h"
#include "trigonometry.h"

#define GC_ROOT_OF_THREE 1.73205081f
#define GC_FARTHEST 60.0f  // exp(-a) is zero beyond it
#define GC_LEAST 1e-5f     // of the variance: more noise than this keeps the equations solvable

static float falling(float a) { return gc_exp(-gc_min(a, GC_FARTHEST)); }

// Return the correlation r of two rates, x = f t.
static float correlation(float x) {
  const float a = GC_ROOT_OF_THREE * gc_abs(x);
  return (1.0f + a + a * a / 3.0f) * falling(a);
}

// Return the integral of r from 0 to x.
static float once(float x) {
  const float a = GC_ROOT_OF_THREE * gc_abs(x);
  const float integral = (8.0f - (8.0f + 5.0f * a + a * a) * falling(a)) / (3.0f * GC_ROOT_OF_THREE);
  return x < 0.0f ? -integral : integral;
}

// Return the integral of `once` from 0 to x.
static float twice(float x) {
  const float a = GC_ROOT_OF_THREE * gc_abs(x);
  return (8.0f * a - 15.0f + (15.0f + 7.0f * a + a * a) * falling(a)) / 9.0f;
}

float gc_likeliest_turn(const gc_swing *swings, uint32_t count, const float *times, const float *noise, float gap,
                        float *weights) {
  float between[GC_KNOWN_RATES][GC_KNOWN_RATES];  // covariance of the rates, then its Cholesky factor
  float angle[GC_KNOWN_RATES];                    // covariance of the rates with the angle
  float variance = 0.0f;
  for (uint32_t i = 0; i < GC_KNOWN_RATES; ++i) {
    angle[i] = 0.0f;
    for (uint32_t j = 0; j <= i; ++j) {
      between[i][j] = 0.0f;
    }
  }
  for (uint32_t k = 0; k < count; ++k) {
    const float size = swings[k].variance, f = swings[k].frequency;
    for (uint32_t i = 0; i < GC_KNOWN_RATES; ++i) {
      angle[i] += size / f * (once(f * (gap - times[i])) + once(f * times[i]));
      for (uint32_t j = 0; j <= i; ++j) {
        between[i][j] += size * correlation(f * (times[i] - times[j]));
      }
    }
    variance += 2.0f * size / (f * f) * twice(f * gap);
  }
  for (uint32_t i = 0; i < GC_KNOWN_RATES; ++i) {
    between[i][i] += noise[i] + GC_LEAST * between[i][i];
    for (uint32_t j = 0; j <= i; ++j) {
      float left = between[i][j];
      for (uint32_t k = 0; k < j; ++k) {
        left -= between[i][k] * between[j][k];
      }
      between[i][j] = i == j ? gc_sqrt(left) : left / between[j][j];
    }
    float rest = angle[i];
    for (uint32_t k = 0; k < i; ++k) {
      rest -= between[i][k] * weights[k];
    }
    weights[i] = rest / between[i][i];
    variance -= weights[i] * weights[i];
  }
  for (uint32_t i = GC_KNOWN_RATES; i-- > 0u;) {
    float rest = weights[i];
    for (uint32_t k = i + 1u; k < GC_KNOWN_RATES; ++k) {
      rest -= between[k][i] * weights[k];
    }
    weights[i] = rest / between[i][i];
  }
  return gc_max(variance, 0.0f);
}
