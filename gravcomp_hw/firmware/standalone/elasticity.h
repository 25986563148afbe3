// Elasticity of the reduced model: the strain as polynomials of the coordinates (src/gravcomp/reduction/strain_polynomials.py).
//
// eps_m(q) = q_m + 1/2 q . B_m q (without q_m for m >= r),    sigma = a eps + b,    force = J^T sigma,    J = d eps / d q,
// K = a J^T J + sum sigma_m B_m, with a and b of what the material remembers (creep.h).
#ifndef GC_ELASTICITY_H
#define GC_ELASTICITY_H

#include "creep.h"
#include "model.h"

// Elasticity at coordinates q. jacobian: of every block of four strains by all coordinates; force in J^(1/2).
typedef struct {
  float jacobian[GC_STRAINS_MAX / GC_TILE][GC_MODES_MAX][GC_TILE];
  float strain[GC_STRAINS_MAX];
  float stress[GC_STRAINS_MAX];
  float scale;  // a
  float force[GC_MODES_MAX];
} gc_elasticity;

// Compute the elasticity at q (r,). Reads B once.
void gc_elasticity_at(const gc_model *model, const float *q, const gc_creep *creep, gc_elasticity *at);

// Write the stiffness (r, r) at q by tiles.
void gc_elasticity_stiffness(const gc_model *model, const gc_elasticity *at, float *matrix);

#endif
