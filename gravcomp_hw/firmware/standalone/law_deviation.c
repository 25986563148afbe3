#include "law_deviation.h"

#include "../core/maths.h"
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

// Components of E in which row and column of a symmetric (3, 3) are.
static const uint8_t COMPONENT[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};

// Write A (9, 9) = B^T D B with B = dE/dH, plus T where F and H have the same row.
static void stiffness_of(const float f[ROWS], const float t[6], float d[6][6], float a[ROWS][ROWS]) {
  // Column 3 i + j of B has row i of F in the components of E that contain j.
  const float full[3][3] = {{t[0], t[3], t[5]}, {t[3], t[1], t[4]}, {t[5], t[4], t[2]}};
  for (uint32_t c = 0; c < ROWS; ++c) {
    const uint8_t *own = COMPONENT[c % 3u];
    const float *row = f + c / 3u * 3u;
    float db[6];
    for (uint32_t m = 0; m < 6u; ++m) {
      db[m] = (d[m][own[0]] * row[0] + d[m][own[1]] * row[1]) + d[m][own[2]] * row[2];
    }
    for (uint32_t k = 0; k <= c; ++k) {
      const uint8_t *other = COMPONENT[k % 3u];
      const float *left = f + k / 3u * 3u;
      const float sum = k / 3u == c / 3u ? full[k % 3u][c % 3u] : 0.0f;
      a[k][c] = a[c][k] = sum + ((left[0] * db[other[0]] + left[1] * db[other[1]]) + left[2] * db[other[2]]);
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

// Put A (9, 9) of a point in the place of the one before; A becomes the difference.
static void renew(float *part, float a[ROWS][ROWS]) {
  for (uint32_t i = 0; i < ROWS; ++i) {
    for (uint32_t j = 0; j <= i; ++j, ++part) {
      const float before = *part;
      *part = a[i][j];
      a[i][j] = a[j][i] = a[i][j] - before;
    }
  }
}

void gc_law_deviation_at(const gc_model *model, const float *q, gc_law_deviation *state, float *force) {
  const uint32_t r = model->modes;
  const uint32_t share = (uint32_t)gc_clamp(model->settings->law_share, 1.0f, (float)GC_LAW_POINTS_MAX);
  const uint32_t end = state->turn + share < model->law_points ? state->turn + share : model->law_points;
  float own[GC_MODES_MAX];
  for (uint32_t i = 0; i < r; ++i) {
    own[i] = 0.0f;
  }
  for (uint32_t p = 0; p < model->law_points; ++p) {
    const float *change = model->law_change + (size_t)p * ROWS * r;
    const bool is_due = p >= state->turn && p < end;
    float f[ROWS], e[6], t[6], d[6][6], piola[ROWS];
    deform(change, r, q, f, e);
    gc_law_deviating_stress(&model->law[p], e, t, is_due ? d : NULL);
    product(f, t, piola);
    for (uint32_t i = 0; i < r; ++i) {
      float sum = own[i];
      for (uint32_t a = 0; a < ROWS; ++a) {
        sum += change[i * ROWS + a] * piola[a];
      }
      own[i] = sum;
    }
    if (is_due) {
      float a[ROWS][ROWS];
      stiffness_of(f, t, d, a);
      renew(state->part[p], a);
      add_stiffness(change, r, a, state->stiffness);
    }
  }
  state->turn = end < model->law_points ? end : 0u;
  for (uint32_t i = 0; i < r; ++i) {
    force[i] += own[i];
  }
}

void gc_law_deviation_add_stiffness(const gc_model *model, const gc_law_deviation *state, float *matrix, float factor) {
  for (uint32_t k = 0; k < model->modes * (model->modes + 1u) / 2u; ++k) {
    matrix[k] += factor * state->stiffness[k];
  }
}
