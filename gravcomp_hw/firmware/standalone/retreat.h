// Recovery when the equilibrium is lost or the loop is stuck (src/gravcomp/inverse/retreat.py).
#ifndef GC_RETREAT_H
#define GC_RETREAT_H

#include "model.h"
#include "target.h"

typedef enum { GC_ONWARD = 0, GC_BACK = 1, GC_PAY_OUT = 2 } gc_move;

typedef struct {
  float stride;  // fraction of the usual stride that a step may take
  uint32_t lost, lost_times, still, tries;
  float until;   // N: largest tension at which the next attempt starts, below 0: none
  gc_target target;
  bool has_target;
  float tip_at_rest[3];  // m
} gc_retreat;

// Start from the straight robot.
void gc_retreat_reset(gc_retreat *retreat, const gc_settings *settings);

// Return the next move. followed: the model reached an equilibrium under the last command; tip (3,) in m and largest tension
// in N of its present shape.
gc_move gc_retreat_move(gc_retreat *retreat, const gc_settings *settings, bool followed, const gc_target *target,
                        const float *tip, float largest_tension);

// Record a move onward: the largest change of a winch's displacement in m, within `interval` s.
void gc_retreat_observe(gc_retreat *retreat, const gc_settings *settings, float change, float interval);

#endif
