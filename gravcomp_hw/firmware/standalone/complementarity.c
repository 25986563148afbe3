#include "complementarity.h"

#include "../core/maths.h"

#define GC_SLACK_ROUNDING 1e-9f  // m of slack that is rounding error

// Solve A x = b for n unknowns in place, with row pivots; x replaces b. Returns false where A is singular.
static bool solved(uint32_t n, float (*a)[GC_CABLES_MAX], float *b) {
  for (uint32_t i = 0; i < n; ++i) {
    uint32_t largest = i;
    for (uint32_t k = i + 1u; k < n; ++k) {
      if (gc_abs(a[k][i]) > gc_abs(a[largest][i])) {
        largest = k;
      }
    }
    if (!(gc_abs(a[largest][i]) > 0.0f)) {
      return false;
    }
    for (uint32_t c = i; c < n; ++c) {
      const float swapped = a[i][c];
      a[i][c] = a[largest][c];
      a[largest][c] = swapped;
    }
    const float right = b[i];
    b[i] = b[largest];
    b[largest] = right;
    const float inverse = 1.0f / a[i][i];
    for (uint32_t k = i + 1u; k < n; ++k) {
      const float factor = a[k][i] * inverse;
      for (uint32_t c = i + 1u; c < n; ++c) {
        a[k][c] -= factor * a[i][c];
      }
      b[k] -= factor * b[i];
    }
  }
  for (uint32_t i = n; i-- > 0u;) {
    for (uint32_t c = i + 1u; c < n; ++c) {
      b[i] -= a[i][c] * b[c];
    }
    b[i] /= a[i][i];
  }
  return true;
}

// Write the tensions (m,) of a choice of taut cables. Returns false where their compliance is singular.
static bool tensions_of(uint32_t m, const float (*compliance)[GC_CABLES_MAX], const float *lack, const bool *taut,
                        float *tension) {
  float block[GC_CABLES_MAX][GC_CABLES_MAX], right[GC_CABLES_MAX];
  uint32_t chosen[GC_CABLES_MAX], count = 0;
  for (uint32_t i = 0; i < m; ++i) {
    tension[i] = 0.0f;
    if (taut[i]) {
      chosen[count++] = i;
    }
  }
  for (uint32_t a = 0; a < count; ++a) {
    right[a] = lack[chosen[a]];
    for (uint32_t b = 0; b < count; ++b) {
      block[a][b] = compliance[chosen[a]][chosen[b]];
    }
  }
  if (!solved(count, block, right)) {
    return false;
  }
  for (uint32_t a = 0; a < count; ++a) {
    tension[chosen[a]] = right[a];
  }
  return true;
}

bool gc_taut_tensions(uint32_t m, const float (*compliance)[GC_CABLES_MAX], const float *lack, const bool *held, bool *taut,
                      float *tension) {
  for (uint32_t pivot = 0; pivot < GC_PIVOTS_MAX; ++pivot) {
    if (!tensions_of(m, compliance, lack, taut, tension)) {
      break;
    }
    uint32_t wrong = m;
    for (uint32_t i = 0; i < m && wrong == m; ++i) {
      float slack = -lack[i];
      for (uint32_t k = 0; k < m; ++k) {
        slack += compliance[i][k] * tension[k];
      }
      if (taut[i] ? tension[i] < 0.0f : held[i] && slack < -GC_SLACK_ROUNDING) {
        wrong = i;
      }
    }
    if (wrong == m) {
      return true;
    }
    taut[wrong] = !taut[wrong];
  }
  for (uint32_t i = 0; i < m; ++i) {
    tension[i] = 0.0f;
    taut[i] = false;
  }
  return false;
}
