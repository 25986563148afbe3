// Equilibrium of the reduced model under gravity and the cables' displacements, tracked with the same work at every sample.
//
// src/gravcomp/reduction/tracking.py takes Newton steps until the equilibrium is found. Here every call takes one step to the
// new load, evaluates forces and stiffness at the shape that it reaches, and corrects the result by a second step from there.
// The next call starts from the evaluated shape. The size of the correction over that of the step says how fast this converges,
// and so what is left.
#ifndef GC_EQUILIBRIUM_H
#define GC_EQUILIBRIUM_H

#include "cables.h"
#include "elasticity.h"
#include "law_deviation.h"

#define GC_LOADING_STEPS 50u  // calls after a reset over which gravity and pulls rise from zero
#define GC_EFFECTOR_ROWS 6u  // position and direction of the tip

#define GC_ANSWERS_MAX (GC_CABLES_MAX + 4u)

// Shape of the robot and its linear response to the tensions, as gravcomp.full_model.shape.Response.
typedef struct {
  bool converged;                                             // false: the last equilibrium
  float tip[3];                                               // m, soft_base
  float direction[3];                                         // of the tip
  float tension[GC_CABLES_MAX];                               // N
  float displacement[GC_CABLES_MAX];                          // m, at the winch
  float compliance[GC_CABLES_MAX][GC_CABLES_MAX];             // m/N, of the displacements
  float effector_compliance[GC_EFFECTOR_ROWS][GC_CABLES_MAX]; // of tip and direction
  float lengthening[GC_CABLES_MAX];  // m/N, of the backbone's length from point to point
  float left;                                                 // m, estimated distance of the tip from the equilibrium
} gc_shape;

// State of the tracking. Everything is overwritten by gc_equilibrium_reset.
typedef struct {
  const gc_model *model;
  gc_elasticity elasticity;  // at q
  gc_law_deviation law;      // at q, and at the last shapes
  gc_creep creep;
  gc_cables cables;          // at q
  float q[GC_MODES_MAX];     // where forces and cables were evaluated last
  float tension[GC_CABLES_MAX];
  float correction[GC_MODES_MAX];  // from q to the equilibrium
  float answer[GC_ANSWERS_MAX][GC_MODES_MAX];  // of q to unit tensions (m), to gravity (3), to the elastic forces (1)
  float compliance[GC_CABLES_MAX][GC_CABLES_MAX];
  float stiffness[GC_PAIRS_MAX];
  float factor[GC_PAIRS_MAX];
  float safe_q[GC_MODES_MAX];    // near the last equilibrium, with a stiffness that is positive definite
  float safe_tension[GC_CABLES_MAX];
  uint32_t lost;  // twice the calls without a usable shape, less those with one
  float pulling[GC_CABLES_MAX];  // direction of sliding
  float wound[GC_CABLES_MAX];    // m, last input, NaN: released
  bool taut[GC_CABLES_MAX];
  uint32_t loaded;  // calls since the reset, up to GC_LOADING_STEPS
  bool evaluated;  // forces and cables belong to q
} gc_equilibrium;

// Start from the straight robot.
void gc_equilibrium_reset(gc_equilibrium *state, const gc_model *model);

// Track the equilibrium to gravity (3,) in m/s^2 in soft_base and to cables pulled in to `wound` (m,) in m, NaN: released.
// After a reset gravity and pulls rise from zero over GC_LOADING_STEPS calls, so that one step a call finds each equilibrium.
// Where none is found the shape is the last equilibrium, near which the next call starts; after 20 calls without one, or more of
// which every other one has none, the tracking starts again from the straight robot, and they rise again.
//
// interval: s since the last call, in which the material creeps.
void gc_equilibrium_step(gc_equilibrium *state, const float *gravity, const float *wound, float interval, gc_shape *shape);

#endif
