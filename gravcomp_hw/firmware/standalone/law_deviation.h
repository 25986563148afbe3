// What a law of rubber adds to the elasticity that is quadratic in the strain (src/gravcomp/reduction/law_deviation.py).
//
// At each point of the body that the model names, with H = G q, F = I + H and Green's strain E,
//
//   f += G^T F T,    T = w (S(E) - C : E),    K += G^T A G,    A = d(F T) / dH.
//
// The force is that of all points in each call, so that the equilibrium is the law's. The stiffness is that of the last shapes: each
// call works on a few points, and the sum comes into use when all have had their turn. Meanwhile Powell's symmetric update (Nocedal
// and Wright, Numerical Optimization, 2006, section 6.2) makes it right in the direction in which the shape has just moved:
//
//   K += (y s^T + s y^T) / s.s - (s.y) s s^T / (s.s)^2,    s: change of q,    y = change of the force - K s.
#ifndef GC_LAW_DEVIATION_H
#define GC_LAW_DEVIATION_H

#include "model.h"

// Zero is the state of the straight robot without load.
typedef struct {
  float stiffness[GC_PAIRS_MAX];  // in use, by tiles
  float next[GC_PAIRS_MAX];       // of the points before `turn`
  uint32_t turn;
  float q[GC_MODES_MAX];  // of the last call, and the force there
  float force[GC_MODES_MAX];
} gc_law_deviation;

// Add the force at q (r,) of all points to `force` (r,), and work on the stiffness of the next ones.
void gc_law_deviation_at(const gc_model *model, const float *q, gc_law_deviation *state, float *force);

// Add `factor` times the stiffness to a matrix (r, r) by tiles.
void gc_law_deviation_add_stiffness(const gc_model *model, const gc_law_deviation *state, float *matrix, float factor);

#endif
