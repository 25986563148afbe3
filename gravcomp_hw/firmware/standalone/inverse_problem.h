// The inverse problem of one step as a quadratic programme in the tensions (src/gravcomp/inverse/programme.py).
#ifndef GC_INVERSE_PROBLEM_H
#define GC_INVERSE_PROBLEM_H

#include "equilibrium.h"
#include "quadratic_programme.h"
#include "target.h"

// A programme in scaled tensions, y = tension / scale, so that the Hessian has a unit diagonal; the cost is in mm^2.
typedef struct {
  gc_programme programme;
  float scale[GC_CABLES_MAX];
  float tension_lower[GC_CABLES_MAX], tension_upper[GC_CABLES_MAX];  // N
} gc_inverse_problem;

// Write the programme at the shape for the next `interval` s. displacement (m,): last command in m; damping: factor of the
// proximal term.
void gc_inverse_problem_build(const gc_model *model, const gc_shape *shape, const gc_target *target,
                              const float *displacement, float interval, float damping, gc_inverse_problem *problem);

// Write the unit vector (3,) that splits the tip's error into axial and lateral: the target's direction, else the tip's.
void gc_tip_axis(const gc_target *target, const float *tip_direction, float *axis);

#endif
