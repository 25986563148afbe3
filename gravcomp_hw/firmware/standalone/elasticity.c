#include "elasticity.h"

// Add B q of one tile of four rows to their rows of J, and its transpose to the rows j of J. Returns the tile's end in `b`.
//
// to (r, 4): J of the block; i: first row of the tile.
static const float *tile_product(const float *restrict b, const float *restrict q, uint32_t i, float (*restrict to)[GC_TILE]) {
  const float q_0 = q[i], q_1 = q[i + 1u], q_2 = q[i + 2u], q_3 = q[i + 3u];
  float row_0[GC_TILE] = {0.0f}, row_1[GC_TILE] = {0.0f}, row_2[GC_TILE] = {0.0f}, row_3[GC_TILE] = {0.0f};
  for (uint32_t j = 0; j < i; ++j, b += GC_TILE * GC_TILE) {
    const float q_j = q[j];
    for (uint32_t k = 0; k < GC_TILE; ++k) {
      const float b_0 = b[k], b_1 = b[4u + k], b_2 = b[8u + k], b_3 = b[12u + k];
      row_0[k] += b_0 * q_j;
      row_1[k] += b_1 * q_j;
      row_2[k] += b_2 * q_j;
      row_3[k] += b_3 * q_j;
      to[j][k] += (b_0 * q_0 + b_1 * q_1) + (b_2 * q_2 + b_3 * q_3);
    }
  }
  for (uint32_t k = 0; k < GC_TILE; ++k, ++b) {
    to[i][k] += row_0[k] + ((b[0] * q_0 + b[4] * q_1) + (b[12] * q_2 + b[24] * q_3));
    to[i + 1u][k] += row_1[k] + ((b[4] * q_0 + b[8] * q_1) + (b[16] * q_2 + b[28] * q_3));
    to[i + 2u][k] += row_2[k] + ((b[12] * q_0 + b[16] * q_1) + (b[20] * q_2 + b[32] * q_3));
    to[i + 3u][k] += row_3[k] + ((b[24] * q_0 + b[28] * q_1) + (b[32] * q_2 + b[36] * q_3));
  }
  return b + 36;
}

void gc_elasticity_at(const gc_model *model, const float *q, gc_elasticity *at) {
  const uint32_t r = model->modes, blocks = model->strains / GC_TILE;
  const float *b = model->quadratic;
  for (uint32_t i = 0; i < r; ++i) {
    at->force[i] = 0.0f;
  }
  for (uint32_t block = 0; block < blocks; ++block) {
    float(*jacobian)[GC_TILE] = at->jacobian[block];
    for (uint32_t i = 0; i < r; ++i) {
      jacobian[i][0] = jacobian[i][1] = jacobian[i][2] = jacobian[i][3] = 0.0f;
    }
    for (uint32_t i = 0; i < r; i += GC_TILE) {
      b = tile_product(b, q, i, jacobian);
    }
    float strain[GC_TILE] = {0.0f};
    for (uint32_t i = 0; i < r; ++i) {
      const float half = 0.5f * q[i];
      for (uint32_t k = 0; k < GC_TILE; ++k) {
        strain[k] += half * jacobian[i][k];
      }
    }
    const uint32_t first = GC_TILE * block;
    for (uint32_t k = 0; k < GC_TILE; ++k) {
      if (first < r) {
        jacobian[first + k][k] += 1.0f;
        strain[k] += q[first + k];
      }
      at->strain[first + k] = strain[k];
    }
    for (uint32_t i = 0; i < r; ++i) {
      at->force[i] += (jacobian[i][0] * strain[0] + jacobian[i][1] * strain[1]) +
                      (jacobian[i][2] * strain[2] + jacobian[i][3] * strain[3]);
    }
  }
}

// Return x . y + e . b of four strains.
static inline float entry(const float *restrict x, const float *restrict y, const float *restrict e, const float *restrict b) {
  return ((x[0] * y[0] + x[1] * y[1]) + (x[2] * y[2] + x[3] * y[3])) +
         ((e[0] * b[0] + e[1] * b[1]) + (e[2] * b[2] + e[3] * b[3]));
}

void gc_elasticity_add_stiffness(const gc_model *model, const gc_elasticity *at, uint32_t first, uint32_t end, float *matrix) {
  const uint32_t r = model->modes;
  for (uint32_t block = first; block < end; ++block) {
    const float *b = model->quadratic + (size_t)block * (r * (r + 1u) / 2u) * GC_TILE;
    const float(*jacobian)[GC_TILE] = at->jacobian[block];
    const float *strain = at->strain + GC_TILE * block;
    float *to = matrix;
    for (uint32_t i = 0; i < r; i += GC_TILE) {
      for (uint32_t j = 0; j < i; ++j, b += GC_TILE * GC_TILE, to += GC_TILE) {
        to[0] += entry(jacobian[i], jacobian[j], strain, b);
        to[1] += entry(jacobian[i + 1u], jacobian[j], strain, b + 4);
        to[2] += entry(jacobian[i + 2u], jacobian[j], strain, b + 8);
        to[3] += entry(jacobian[i + 3u], jacobian[j], strain, b + 12);
      }
      for (uint32_t a = 0; a < GC_TILE; ++a) {
        for (uint32_t c = 0; c <= a; ++c, b += GC_TILE, ++to) {
          *to += entry(jacobian[i + a], jacobian[i + c], strain, b);
        }
      }
    }
  }
}
