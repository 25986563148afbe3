// Taking up the backlash of a gear: a motor at rest ends on the flank that winds in, as gravcomp.motors.take_up describes it.
//
//     x = min(w, max(0, x_last - (d - d_last))),   d: displacement of the rotor; 0: on the flank that winds in
//
// Where its target rests and the gear may be loose by x, the motor pays out by the largest backlash w and winds in again, once; at
// the same time as the robot's other motors, when all their targets stay.
#ifndef GC_TAKE_UP_H
#define GC_TAKE_UP_H

#include <stdbool.h>

#include "parameters.h"

typedef enum { GC_TAKEN_UP, GC_TAKE_UP_OUT, GC_TAKE_UP_IN } gc_take_up_phase;

// A target that stays in a band.
typedef struct {
  float target;  // m, in the middle of the band
  float rest;    // s after which it is at rest: longer where it creeps
  float since;   // s for which it stays
  bool done;     // the motor has gone out for it
  gc_take_up_phase phase;
} gc_stay;

// Zeros: the gear is on the flank that winds in, as homing leaves it, and no target is known.
typedef struct {
  bool started;  // last and stay are known
  float last;    // m, displacement of the rotor
  float loose;   // m, by which the gear may be loose
  gc_stay stay;
  bool may_come_back;  // the target, to `left`
  gc_stay left;
  float away;  // s for which it has left
  bool waits;  // for the other motors of the robot
  bool joins;  // one of them begins
} gc_take_up;

// Where a motor goes now on its way to its target.
typedef struct {
  float target;   // m
  float fastest;  // m/s
} gc_way;

void gc_take_up_reset(gc_take_up *take_up);

// Whether the target has stayed for the time of a rest, creeping or not.
bool gc_take_up_stays(const gc_take_up *take_up, const gc_parameters *parameters);

// Whether the target is at rest, and the gear may be loose.
bool gc_take_up_is_due(const gc_take_up *take_up, const gc_parameters *parameters);

// The way to `target` (m); displacement (m) is that of the rotor, `dt` (s) the time since the last step.
gc_way gc_take_up_step(gc_take_up *take_up, const gc_parameters *parameters, float target, float displacement, float dt);

#endif
