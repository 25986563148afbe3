#include "cables.h"

#include "../core/maths.h"
#include "trigonometry.h"

// Subtract `share` times t . D of a piece from a row (r,); change (3, r): D.
static void subtract_row(const float *restrict change, const float *tangent, float share, uint32_t r, float *restrict row) {
  const float x = share * tangent[0], y = share * tangent[1], z = share * tangent[2];
  const float *of_x = change, *of_y = change + r, *of_z = change + 2u * r;
  for (uint32_t a = 0; a < r; a += GC_TILE, row += GC_TILE, of_x += GC_TILE, of_y += GC_TILE, of_z += GC_TILE) {
    row[0] -= (x * of_x[0] + y * of_y[0]) + z * of_z[0];
    row[1] -= (x * of_x[1] + y * of_y[1]) + z * of_z[1];
    row[2] -= (x * of_x[2] + y * of_y[2]) + z * of_z[2];
    row[3] -= (x * of_x[3] + y * of_y[3]) + z * of_z[3];
  }
}

// Write D q (3,) of a piece; change (3, r): D.
static void moved_by(const float *restrict change, const float *restrict q, uint32_t r, float *moved) {
  const float *of_x = change, *of_y = change + r, *of_z = change + 2u * r;
  float x = 0.0f, y = 0.0f, z = 0.0f;
  for (uint32_t a = 0; a < r; a += GC_TILE, q += GC_TILE, of_x += GC_TILE, of_y += GC_TILE, of_z += GC_TILE) {
    const float q_0 = q[0], q_1 = q[1], q_2 = q[2], q_3 = q[3];
    x += (of_x[0] * q_0 + of_x[1] * q_1) + (of_x[2] * q_2 + of_x[3] * q_3);
    y += (of_y[0] * q_0 + of_y[1] * q_1) + (of_y[2] * q_2 + of_y[3] * q_3);
    z += (of_z[0] * q_0 + of_z[1] * q_1) + (of_z[2] * q_2 + of_z[3] * q_3);
  }
  moved[0] = x, moved[1] = y, moved[2] = z;
}

// Return the angle (rad) between the unit vectors a and b: accurate near 0, where the arc cosine is not.
static float angle_between(const float *a, const float *b) {
  const float x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  const float cosine = (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
  return gc_atan2(gc_sqrt((x * x + y * y) + z * z), cosine);
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
    mean[i] += share * at->length[s];
    total[i] += at->length[s];
    subtract_row(model->piece_change + (size_t)s * 3u * r, at->tangent[s], share, r, at->force_jacobian[i]);
  }
  for (uint32_t i = 0; i < m; ++i) {
    at->mean_share[i] = mean[i] / total[i];
    at->stretch[i] = model->axial_compliance[i] * at->mean_share[i];
  }
}

void gc_cables_at(const gc_model *model, const float *q, const float *pulling, gc_cables *at) {
  const uint32_t r = model->modes, m = model->cables;
  bool slides = false;
  for (uint32_t i = 0; i < m; ++i) {
    at->displacement[i] = model->rest_length[i];
    at->stretch[i] = model->axial_compliance[i];
    at->mean_share[i] = 1.0f;
    slides = slides || model->friction[i] * pulling[i] != 0.0f;
    for (uint32_t a = 0; a < r; ++a) {
      at->jacobian[i][a] = 0.0f;
    }
  }
  for (uint32_t s = 0; s < model->pieces; ++s) {
    const float *change = model->piece_change + (size_t)s * 3u * r;
    const uint32_t i = model->piece_cable[s];
    float moved[3];
    moved_by(change, q, r, moved);
    const float *rest = model->piece_rest + 3u * s;
    const float x = rest[0] + moved[0], y = rest[1] + moved[1], z = rest[2] + moved[2];
    const float length = gc_sqrt((x * x + y * y) + z * z), inverse = 1.0f / length;
    at->length[s] = length;
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

void gc_cables_add_stiffness(const gc_model *model, const gc_cables *at, const float *tension, float *matrix) {
  const uint32_t pairs = model->modes * (model->modes + 1u) / 2u, m = model->cables;
  for (uint32_t first = 0; first < m; first += 3u) {  // three tensions stay in registers
    float pull[3] = {0.0f, 0.0f, 0.0f};
    const uint32_t count = m - first < 3u ? m - first : 3u, second = count > 1u ? 1u : 0u, third = count > 2u ? 2u : 0u;
    for (uint32_t i = 0; i < count; ++i) {
      pull[i] = tension[first + i] * at->mean_share[first + i];
    }
    const float a = pull[0], b = pull[1], c = pull[2];
    const float *from = model->cable_stiffness + first;
    for (uint32_t k = 0; k < pairs; ++k, from += m) {
      matrix[k] += (a * from[0] + b * from[second]) + c * from[third];
    }
  }
}
