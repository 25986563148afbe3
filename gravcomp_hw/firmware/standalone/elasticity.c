#include "elasticity.h"

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
  four row_0 = loaded(to[i]), row_1 = loaded(to[i + 1u]), row_2 = loaded(to[i + 2u]), row_3 = loaded(to[i + 3u]);
  for (uint32_t j = 0; j < i; ++j, b += GC_TILE * GC_TILE) {
    const float q_j = q[j];
    four column = loaded(to[j]), entry = loaded(b);
    row_0 = added(row_0, q_j, entry), column = added(column, q_0, entry), entry = loaded(b + 4);
    row_1 = added(row_1, q_j, entry), column = added(column, q_1, entry), entry = loaded(b + 8);
    row_2 = added(row_2, q_j, entry), column = added(column, q_2, entry), entry = loaded(b + 12);
    row_3 = added(row_3, q_j, entry), column = added(column, q_3, entry);
    store(to[j], column);
  }
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
    for (uint32_t i = 0; i < r; ++i) {
      const four row = loaded(jacobian[i]);
      at->force[i] = (((at->force[i] + row.x * strain.x) + row.y * strain.y) + row.z * strain.z) + row.w * strain.w;
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
    const four strain = loaded(at->strain + GC_TILE * block);
    float *to = matrix;
    for (uint32_t i = 0; i < r; i += GC_TILE) {
      const four row_0 = loaded(jacobian[i]), row_1 = loaded(jacobian[i + 1u]);
      const four row_2 = loaded(jacobian[i + 2u]), row_3 = loaded(jacobian[i + 3u]);
      for (uint32_t j = 0; j < i; ++j, b += GC_TILE * GC_TILE, to += GC_TILE) {
        // The sums of the four rows do not depend on one another: the processor need not wait for any.
        const four column = loaded(jacobian[j]);
        four sum = loaded(to);
        sum = added(sum, column.x, (four){row_0.x, row_1.x, row_2.x, row_3.x});
        sum = added(sum, column.y, (four){row_0.y, row_1.y, row_2.y, row_3.y});
        sum = added(sum, column.z, (four){row_0.z, row_1.z, row_2.z, row_3.z});
        sum = added(sum, column.w, (four){row_0.w, row_1.w, row_2.w, row_3.w});
        sum = added(sum, strain.x, (four){b[0], b[4], b[8], b[12]});
        sum = added(sum, strain.y, (four){b[1], b[5], b[9], b[13]});
        sum = added(sum, strain.z, (four){b[2], b[6], b[10], b[14]});
        sum = added(sum, strain.w, (four){b[3], b[7], b[11], b[15]});
        store(to, sum);
      }
      for (uint32_t a = 0; a < GC_TILE; ++a) {
        for (uint32_t c = 0; c <= a; ++c, b += GC_TILE, ++to) {
          *to = entry_of(*to, loaded(jacobian[i + a]), loaded(jacobian[i + c]), strain, b);
        }
      }
    }
  }
}
