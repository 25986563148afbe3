// The cascaded position loop of one cable, as gravcomp.motors.loop describes it, in float32.
#ifndef GC_POSITION_LOOP_H
#define GC_POSITION_LOOP_H

#include "parameters.h"

typedef struct {
  float setpoint;           // m
  float setpoint_velocity;  // m/s
  float integral;           // A
} gc_position_loop;

// Start at rest at a displacement (m) with a current (A) that holds the cable there.
void gc_position_loop_reset(gc_position_loop *loop, float displacement, float holding);

// Distance (m) from its target within which the loop is at rest.
float gc_position_loop_rest_error(const gc_parameters *parameters);

// What a step needs in addition to the parameters.
typedef struct {
  float target;        // m
  float pull;          // N, feed-forward
  float displacement;  // m, measured
  float velocity;      // m/s, measured
  float fastest;       // m/s, largest velocity
  float dt;            // s since the last step
} gc_position_input;

// Current (A) toward the target.
float gc_position_loop_step(gc_position_loop *loop, const gc_parameters *parameters, const gc_position_input *input);

#endif
