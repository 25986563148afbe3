#include "elasticity.h"

#include "kernels.h"

// Four strains of one entry, in registers.
typedef struct {
  float x, y, z, w;
} four;

#define GC_INLINE static inline __attribute__((always_inline))

GC_INLINE four loaded(const float *from) { return (four){from[0], from[1], from[2], from[3]}; }

GC_INLINE void store(float *to, four value) {
  to[0] = value.x;
  to[1] = value.y;
  to[2] = value.z;
  to[3] = value.w;
}

// Return sum + factor b.
GC_INLINE four added(four sum, float factor, four b) {
  const float x = factor * b.x, y = factor * b.y, z = factor * b.z, w = factor * b.w;
  return (four){sum.x + x, sum.y + y, sum.z + z, sum.w + w};
}

// Add B q of one tile of four rows to their rows of J, and its transpose to the rows j of J. Returns the end of the tile.
//
// to (r, 4): J of the block; i: first row of the tile.
static const float *tile_product(const float *restrict b, const float *restrict q, uint32_t i, float (*restrict to)[GC_TILE]) {
  const float q_0 = q[i], q_1 = q[i + 1u], q_2 = q[i + 2u], q_3 = q[i + 3u];
  gc_tile_products(b, q, q + i, i, to, to + i);
  b += GC_TILE * GC_TILE * i;
  four row_0 = loaded(to[i]), row_1 = loaded(to[i + 1u]), row_2 = loaded(to[i + 2u]), row_3 = loaded(to[i + 3u]);
  four entry = loaded(b);
  row_0 = added(row_0, q_0, entry), entry = loaded(b + 4);
  row_0 = added(row_0, q_1, entry), row_1 = added(row_1, q_0, entry), entry = loaded(b + 8);
  row_1 = added(row_1, q_1, entry), entry = loaded(b + 12);
  row_0 = added(row_0, q_2, entry), row_2 = added(row_2, q_0, entry), entry = loaded(b + 16);
  row_1 = added(row_1, q_2, entry), row_2 = added(row_2, q_1, entry), entry = loaded(b + 20);
  row_2 = added(row_2, q_2, entry), entry = loaded(b + 24);
  row_0 = added(row_0, q_3, entry), row_3 = added(row_3, q_0, entry), entry = loaded(b + 28);
  row_1 = added(row_1, q_3, entry), row_3 = added(row_3, q_1, entry), entry = loaded(b + 32);
  row_2 = added(row_2, q_3, entry), row_3 = added(row_3, q_2, entry), entry = loaded(b + 36);
  row_3 = added(row_3, q_3, entry);
  store(to[i], row_0), store(to[i + 1u], row_1), store(to[i + 2u], row_2), store(to[i + 3u], row_3);
  return b + 40;
}

void gc_elasticity_at(const gc_model *model, const float *q, const gc_creep *creep, gc_elasticity *at) {
  const uint32_t r = model->modes, blocks = model->strains / GC_TILE;
  const float *b = model->quadratic;
  at->scale = creep->scale;
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
    four strain = {0.0f, 0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < r; ++i) {
      strain = added(strain, 0.5f * q[i], loaded(jacobian[i]));
    }
    const uint32_t first = GC_TILE * block;
    if (first < r) {  // the strains of the coordinates themselves
      strain.x += q[first], strain.y += q[first + 1u], strain.z += q[first + 2u], strain.w += q[first + 3u];
      jacobian[first][0] += 1.0f, jacobian[first + 1u][1] += 1.0f;
      jacobian[first + 2u][2] += 1.0f, jacobian[first + 3u][3] += 1.0f;
    }
    store(at->strain + first, strain);
    const four stress = added(loaded(creep->offset + first), creep->scale, strain);
    store(at->stress + first, stress);
    for (uint32_t i = 0; i < r; ++i) {
      const four row = loaded(jacobian[i]);
      at->force[i] = (((at->force[i] + row.x * stress.x) + row.y * stress.y) + row.z * stress.z) + row.w * stress.w;
    }
  }
}

// Write four rows of J times a.
GC_INLINE void scaled(const float (*rows)[GC_TILE], float scale, float (*to)[GC_TILE]) {
  for (uint32_t a = 0; a < GC_TILE; ++a) {
    for (uint32_t k = 0; k < GC_TILE; ++k) {
      to[a][k] = scale * rows[a][k];
    }
  }
}

// Return sum + x . y + e . b of four strains.
GC_INLINE float entry_of(float sum, four x, four y, four e, const float *b) {
  sum = (((sum + x.x * y.x) + x.y * y.y) + x.z * y.z) + x.w * y.w;
  return (((sum + e.x * b[0]) + e.y * b[1]) + e.z * b[2]) + e.w * b[3];
}

void gc_elasticity_stiffness(const gc_model *model, const gc_elasticity *at, float *matrix) {
  const uint32_t r = model->modes, pairs = r * (r + 1u) / 2u;
  const float *b = model->quadratic;
  for (uint32_t k = 0; k < pairs; ++k) {
    matrix[k] = 0.0f;
  }
  for (uint32_t block = 0; block < model->strains / GC_TILE; ++block) {
    const float(*jacobian)[GC_TILE] = at->jacobian[block];
    const float *stress = at->stress + GC_TILE * block;
    const four own = loaded(stress);
    float *to = matrix;
    for (uint32_t i = 0; i < r; i += GC_TILE) {
      float rows[GC_TILE][GC_TILE];
      scaled(jacobian + i, at->scale, rows);
      gc_tile_stiffness(b, (const float(*)[GC_TILE])rows, jacobian, stress, i, to);
      b += GC_TILE * GC_TILE * i;
      to += GC_TILE * i;
      const four r_0 = loaded(jacobian[i]), r_1 = loaded(jacobian[i + 1u]);
      const four r_2 = loaded(jacobian[i + 2u]), r_3 = loaded(jacobian[i + 3u]);
      const four s_0 = loaded(rows[0]), s_1 = loaded(rows[1]), s_2 = loaded(rows[2]), s_3 = loaded(rows[3]);
      to[0] = entry_of(to[0], s_0, r_0, own, b);
      to[1] = entry_of(to[1], s_1, r_0, own, b + 4);
      to[2] = entry_of(to[2], s_1, r_1, own, b + 8);
      to[3] = entry_of(to[3], s_2, r_0, own, b + 12);
      to[4] = entry_of(to[4], s_2, r_1, own, b + 16);
      to[5] = entry_of(to[5], s_2, r_2, own, b + 20);
      to[6] = entry_of(to[6], s_3, r_0, own, b + 24);
      to[7] = entry_of(to[7], s_3, r_1, own, b + 28);
      to[8] = entry_of(to[8], s_3, r_2, own, b + 32);
      to[9] = entry_of(to[9], s_3, r_3, own, b + 36);
      b += 40;
      to += 10;
    }
  }
}
