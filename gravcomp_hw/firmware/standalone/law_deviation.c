#include "law_deviation.h"

#include "law_of_invariants.h"

#define ROWS 9u  // of H

// Write F (3, 3), and E from 2 E = H + H^T + H^T H, at q.
static void deform(const float *change, uint32_t r, const float *q, float f[ROWS], float e[6]) {
  float h[ROWS];
  for (uint32_t a = 0; a < ROWS; ++a) {
    h[a] = 0.0f;
  }
  for (uint32_t i = 0; i < r; ++i, change += ROWS) {
    for (uint32_t a = 0; a < ROWS; ++a) {
      h[a] += change[a] * q[i];
    }
  }
  for (uint32_t a = 0; a < ROWS; ++a) {
    f[a] = a % 4u == 0u ? 1.0f + h[a] : h[a];
  }
  for (uint32_t i = 0; i < 3u; ++i) {
    const uint32_t j = (i + 1u) % 3u;
    const float own = (h[i] * h[i] + h[3u + i] * h[3u + i]) + h[6u + i] * h[6u + i];
    e[i] = h[4u * i] + 0.5f * own;
    const float shear = (h[i] * h[j] + h[3u + i] * h[3u + j]) + h[6u + i] * h[6u + j];
    e[i == 2u ? 5u : 3u + i] = (h[3u * i + j] + h[3u * j + i]) + shear;
  }
}

// Write F T (3, 3), of a symmetric T in the order of e.
static void product(const float f[ROWS], const float t[6], float piola[ROWS]) {
  for (uint32_t i = 0; i < 3u; ++i) {
    const float x = f[3u * i], y = f[3u * i + 1u], z = f[3u * i + 2u];
    piola[3u * i] = (x * t[0] + y * t[3]) + z * t[5];
    piola[3u * i + 1u] = (x * t[3] + y * t[1]) + z * t[4];
    piola[3u * i + 2u] = (x * t[5] + y * t[4]) + z * t[2];
  }
}

// Write A (9, 9) = B^T D B with B = dE/dH, plus T where F and H have the same row.
static void stiffness_of(const float f[ROWS], const float t[6], float d[6][6], float a[ROWS][ROWS]) {
  float b[6][ROWS];
  for (uint32_t m = 0; m < 6u; ++m) {
    for (uint32_t c = 0; c < ROWS; ++c) {
      b[m][c] = 0.0f;
    }
  }
  for (uint32_t i = 0; i < 3u; ++i) {
    const float x = f[3u * i], y = f[3u * i + 1u], z = f[3u * i + 2u];
    const uint32_t c = 3u * i;
    b[0][c] = b[3][c + 1u] = b[5][c + 2u] = x;
    b[1][c + 1u] = b[3][c] = b[4][c + 2u] = y;
    b[2][c + 2u] = b[4][c + 1u] = b[5][c] = z;
  }
  const float full[3][3] = {{t[0], t[3], t[5]}, {t[3], t[1], t[4]}, {t[5], t[4], t[2]}};
  for (uint32_t c = 0; c < ROWS; ++c) {
    float db[6];
    for (uint32_t m = 0; m < 6u; ++m) {
      db[m] = 0.0f;
      for (uint32_t n = 0; n < 6u; ++n) {
        db[m] += d[m][n] * b[n][c];
      }
    }
    for (uint32_t k = 0; k < ROWS; ++k) {
      float sum = k / 3u == c / 3u ? full[k % 3u][c % 3u] : 0.0f;
      for (uint32_t m = 0; m < 6u; ++m) {
        sum += b[m][k] * db[m];
      }
      a[k][c] = sum;
    }
  }
}

// Add G^T A G to a matrix by tiles.
static void add_stiffness(const float *change, uint32_t r, float a[ROWS][ROWS], float *to) {
  for (uint32_t i = 0; i < r; i += GC_TILE) {
    float left[ROWS][GC_TILE];
    for (uint32_t k = 0; k < ROWS; ++k) {
      for (uint32_t t = 0; t < GC_TILE; ++t) {
        float sum = 0.0f;
        for (uint32_t c = 0; c < ROWS; ++c) {
          sum += a[k][c] * change[(i + t) * ROWS + c];
        }
        left[k][t] = sum;
      }
    }
    for (uint32_t j = 0; j < i; ++j, to += GC_TILE) {
      float x = to[0], y = to[1], z = to[2], w = to[3];
      for (uint32_t k = 0; k < ROWS; ++k) {
        const float g = change[j * ROWS + k];
        x += left[k][0] * g, y += left[k][1] * g, z += left[k][2] * g, w += left[k][3] * g;
      }
      to[0] = x, to[1] = y, to[2] = z, to[3] = w;
    }
    for (uint32_t t = 0; t < GC_TILE; ++t) {
      for (uint32_t j = i; j <= i + t; ++j, ++to) {
        for (uint32_t k = 0; k < ROWS; ++k) {
          *to += left[k][t] * change[j * ROWS + k];
        }
      }
    }
  }
}

static void use_next(const gc_model *model, gc_law_deviation *state) {
  for (uint32_t k = 0; k < model->modes * (model->modes + 1u) / 2u; ++k) {
    state->stiffness[k] = state->next[k];
    state->next[k] = 0.0f;
  }
  state->turn = 0u;
}

void gc_law_deviation_at(const gc_model *model, const float *q, gc_law_deviation *state, float *force) {
  const uint32_t r = model->modes;
  const uint32_t end = state->turn + GC_LAW_SHARE < model->law_points ? state->turn + GC_LAW_SHARE : model->law_points;
  for (uint32_t p = 0; p < model->law_points; ++p) {
    const float *change = model->law_change + (size_t)p * ROWS * r;
    const bool is_due = p >= state->turn && p < end;
    float f[ROWS], e[6], t[6], d[6][6], piola[ROWS];
    deform(change, r, q, f, e);
    gc_law_deviating_stress(&model->law[p], e, t, is_due ? d : NULL);
    product(f, t, piola);
    for (uint32_t i = 0; i < r; ++i) {
      float sum = force[i];
      for (uint32_t a = 0; a < ROWS; ++a) {
        sum += change[i * ROWS + a] * piola[a];
      }
      force[i] = sum;
    }
    if (is_due) {
      float a[ROWS][ROWS];
      stiffness_of(f, t, d, a);
      add_stiffness(change, r, a, state->next);
    }
  }
  state->turn = end;
  if (end == model->law_points) {
    use_next(model, state);
  }
}

void gc_law_deviation_add_stiffness(const gc_model *model, const gc_law_deviation *state, float *matrix) {
  for (uint32_t k = 0; k < model->modes * (model->modes + 1u) / 2u; ++k) {
    matrix[k] += state->stiffness[k];
  }
}
