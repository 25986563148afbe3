#include "cables.h"

#include "trigonometry.h"

// Subtract `share` times t . D of a piece from a row (r,); change (3, r): D.
static void subtract_row(const float *restrict change, const float *tangent, float share, uint32_t r, float *restrict row) {
  const float x = share * tangent[0], y = share * tangent[1], z = share * tangent[2];
  const float *of_x = change, *of_y = change + r, *of_z = change + 2u * r;
  for (uint32_t a = 0; a < r; a += GC_TILE) {
    for (uint32_t k = a; k < a + GC_TILE; ++k) {
      row[k] -= (x * of_x[k] + y * of_y[k]) + z * of_z[k];
    }
  }
}

// Return row . q of r numbers.
static float along(const float *restrict row, const float *restrict q, uint32_t r) {
  float s_0 = 0.0f, s_1 = 0.0f, s_2 = 0.0f, s_3 = 0.0f;
  for (uint32_t a = 0; a < r; a += GC_TILE) {
    s_0 += row[a] * q[a];
    s_1 += row[a + 1u] * q[a + 1u];
    s_2 += row[a + 2u] * q[a + 2u];
    s_3 += row[a + 3u] * q[a + 3u];
  }
  return (s_0 + s_1) + (s_2 + s_3);
}

// Return the angle (rad) between the unit vectors a and b: accurate near 0, where the arc cosine is not.
static float angle_between(const float *a, const float *b) {
  const float x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  const float cosine = (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
  return gc_atan2(__builtin_sqrtf((x * x + y * y) + z * z), cosine);
}

// Return (1 - exp(-turn)) / turn.
static float mean_of_sheath(float turn) {
  if (turn < 1e-2f && turn > -1e-2f) {
    return 1.0f - turn * (0.5f - turn * (1.0f / 6.0f));
  }
  return (1.0f - gc_exp(-turn)) / turn;
}

// Compute share, force_jacobian and stretch of cables with capstan friction (src/gravcomp/cables/friction.py).
static void add_friction(const gc_model *model, const float *pulling, gc_cables *at) {
  const uint32_t r = model->modes, m = model->cables;
  float mean[GC_CABLES_MAX], total[GC_CABLES_MAX], turned = 0.0f;
  for (uint32_t i = 0; i < m; ++i) {
    const float coefficient = model->friction[i] * pulling[i];
    mean[i] = model->free_length[i] * mean_of_sheath(coefficient * model->sheath_angle[i]);
    total[i] = model->free_length[i];
    for (uint32_t a = 0; a < r; ++a) {
      at->force_jacobian[i][a] = 0.0f;
    }
  }
  for (uint32_t s = 0; s < model->pieces; ++s) {
    const uint32_t i = model->piece_cable[s];
    if (s > 0u && model->piece_cable[s - 1u] == i) {
      turned += angle_between(at->tangent[s], at->tangent[s - 1u]);
    } else {
      turned = model->sheath_angle[i];
    }
    const float share = gc_exp(-(model->friction[i] * pulling[i]) * turned);
    at->share[s] = share;
    mean[i] += share * at->length[s];
    total[i] += at->length[s];
    subtract_row(model->piece_change + (size_t)s * 3u * r, at->tangent[s], share, r, at->force_jacobian[i]);
  }
  for (uint32_t i = 0; i < m; ++i) {
    at->stretch[i] = model->axial_compliance[i] * (mean[i] / total[i]);
  }
}

void gc_cables_at(const gc_model *model, const float *q, const float *pulling, gc_cables *at) {
  const uint32_t r = model->modes, m = model->cables;
  bool slides = false;
  for (uint32_t i = 0; i < m; ++i) {
    at->displacement[i] = model->rest_length[i];
    at->stretch[i] = model->axial_compliance[i];
    slides = slides || model->friction[i] * pulling[i] != 0.0f;
    for (uint32_t a = 0; a < r; ++a) {
      at->jacobian[i][a] = 0.0f;
    }
  }
  for (uint32_t s = 0; s < model->pieces; ++s) {
    const float *change = model->piece_change + (size_t)s * 3u * r;
    const uint32_t i = model->piece_cable[s];
    const float x = model->piece_rest[3u * s] + along(change, q, r);
    const float y = model->piece_rest[3u * s + 1u] + along(change + r, q, r);
    const float z = model->piece_rest[3u * s + 2u] + along(change + 2u * r, q, r);
    const float length = __builtin_sqrtf((x * x + y * y) + z * z), inverse = 1.0f / length;
    at->length[s] = length;
    at->share[s] = 1.0f;
    at->displacement[i] -= length;
    at->tangent[s][0] = x * inverse, at->tangent[s][1] = y * inverse, at->tangent[s][2] = z * inverse;
    subtract_row(change, at->tangent[s], 1.0f, r, at->jacobian[i]);
  }
  if (slides) {
    add_friction(model, pulling, at);
    return;
  }
  for (uint32_t i = 0; i < m; ++i) {
    for (uint32_t a = 0; a < r; ++a) {
      at->force_jacobian[i][a] = at->jacobian[i][a];
    }
  }
}

// Write the rows a^T D and b^T D, both times `root`, of a piece into rows (2, r): a and b are unit vectors across t.
static void rows_across(const float *restrict change, const float *t, float root, uint32_t r, float (*restrict rows)[GC_MODES_MAX]) {
  // Duff et al., Building an orthonormal basis, revisited (JCGT 2017).
  const float x = t[0], y = t[1], z = t[2], sign = z >= 0.0f ? 1.0f : -1.0f;
  const float p = -1.0f / (sign + z), s = x * y * p;
  const float a_x = root * (1.0f + sign * x * x * p), a_y = root * sign * s, a_z = -root * sign * x;
  const float b_x = root * s, b_y = root * (sign + y * y * p), b_z = -root * y;
  for (uint32_t i = 0; i < r; ++i) {
    const float d_x = change[i], d_y = change[r + i], d_z = change[2u * r + i];
    rows[0][i] = (a_x * d_x + a_y * d_y) + a_z * d_z;
    rows[1][i] = (b_x * d_x + b_y * d_y) + b_z * d_z;
  }
}

void gc_cables_add_stiffness(const gc_model *model, const gc_cables *at, const float *tension, uint32_t first, uint32_t end,
                             float *matrix) {
  const uint32_t r = model->modes;
  float rows[2][GC_MODES_MAX];
  for (uint32_t s = first; s < end; ++s) {
    const float pull = at->share[s] * tension[model->piece_cable[s]];
    if (!(pull > 0.0f)) {
      continue;
    }
    rows_across(model->piece_change + (size_t)s * 3u * r, at->tangent[s], __builtin_sqrtf(pull / at->length[s]), r, rows);
    const float *a = rows[0], *b = rows[1];
    float *to = matrix;
    for (uint32_t i = 0; i < r; i += GC_TILE) {
      const float a_0 = a[i], a_1 = a[i + 1u], a_2 = a[i + 2u], a_3 = a[i + 3u];
      const float b_0 = b[i], b_1 = b[i + 1u], b_2 = b[i + 2u], b_3 = b[i + 3u];
      for (uint32_t j = 0; j < i; ++j, to += GC_TILE) {
        const float a_j = a[j], b_j = b[j];
        to[0] += a_0 * a_j + b_0 * b_j;
        to[1] += a_1 * a_j + b_1 * b_j;
        to[2] += a_2 * a_j + b_2 * b_j;
        to[3] += a_3 * a_j + b_3 * b_j;
      }
      for (uint32_t k = i; k < i + GC_TILE; ++k) {
        for (uint32_t c = i; c <= k; ++c, ++to) {
          *to += a[k] * a[c] + b[k] * b[c];
        }
      }
    }
  }
}
