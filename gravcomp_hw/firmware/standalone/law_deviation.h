// What a law of rubber adds to the elasticity that is quadratic in the strain (src/gravcomp/reduction/law_deviation.py).
//
// At each point of the body that the model names, with H = G q, F = I + H and Green's strain E,
//
//   f += G^T F T,    T = w (S(E) - C : E),    K += G^T A G,    A = d(F T) / dH.
//
// The force is that of all points in each call, so that the equilibrium is the law's. The stiffness is that of the last shapes: each
// call renews the part of a few points, in turn. A secant of the last motion does not correct it: by Powell's symmetric update the
// response of a robot that is nearly unstable jumped from call to call. Rounding errors of the sum are 2e-4 of it after a day of
// motion, and a robot at rest adds none.
#ifndef GC_LAW_DEVIATION_H
#define GC_LAW_DEVIATION_H

#include "model.h"

#define GC_LAW_ENTRIES 45u  // of the lower triangle of A, row by row

// Zero is the state of the straight robot without load, at which A is zero.
typedef struct {
  float stiffness[GC_PAIRS_MAX];                  // by tiles
  float part[GC_LAW_POINTS_MAX][GC_LAW_ENTRIES];  // A of each point in it
  uint32_t turn;                                  // the next point
} gc_law_deviation;

// Add the force at q (r,) of all points to `force` (r,), and work on the stiffness of the next ones.
void gc_law_deviation_at(const gc_model *model, const float *q, gc_law_deviation *state, float *force);

// Add `factor` times the stiffness to a matrix (r, r) by tiles.
void gc_law_deviation_add_stiffness(const gc_model *model, const gc_law_deviation *state, float *matrix, float factor);

#endif
