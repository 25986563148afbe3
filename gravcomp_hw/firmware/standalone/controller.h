// The inverse controller: winch displacements that bring the modelled robot to its target (src/gravcomp/inverse/controller.py).
#ifndef GC_CONTROLLER_H
#define GC_CONTROLLER_H

#include "inverse_problem.h"
#include "retreat.h"

// Codes of gravcomp_msgs/ControllerStatus.
typedef enum {
  GC_CODE_INACTIVE = 0,
  GC_CODE_OK = 1,
  GC_CODE_AT_LIMIT = 2,
  GC_CODE_UNREACHABLE = 3,
  GC_CODE_SOLVER_FAILED = 6,
  GC_CODE_RELAXING = 7
} gc_code;

typedef struct {
  const gc_model *model;
  float displacement[GC_CABLES_MAX];        // m, last command
  float tension[GC_CABLES_MAX];             // N, of the last command
  float change[GC_CABLES_MAX];              // m, of the last programme's path displacement
  float damping;                            // factor of the proximal term
  gc_retreat retreat;
  gc_code code;
  uint32_t solver_steps;                    // of the last programme
} gc_inverse_controller;

// Start from cables at displacement 0, from which rate limits count.
void gc_inverse_reset(gc_inverse_controller *controller, const gc_model *model);

// Compute the command that brings the modelled robot nearest to the target; the controller holds it. interval: s since the
// last step. Where the shape has not converged the command goes back to the last equilibrium, then pays the cables out.
void gc_inverse_step(gc_inverse_controller *controller, const gc_shape *shape, const gc_target *target, float interval);

#endif
