// One motor behind the board: rotor, zero position, the clamp of its current, its position loop.
#ifndef GC_MOTOR_H
#define GC_MOTOR_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"
#include "position_loop.h"
#include "rotor.h"
#include "take_up.h"

typedef struct {
  gc_rotor rotor;
  bool zero_known;
  int32_t zero;     // count at displacement 0
  int32_t wanted;   // mA, as the motor counts, of the host or of the loop
  int16_t current;  // mA, as sent
  float heat;       // A^2, square of the current through the lag of the winding
  bool clamped;     // the last current was smaller than wanted
  bool at_stroke;   // because of the stroke
  float target;     // m
  float tension;    // N, expected
  gc_position_loop loop;
  gc_take_up take_up;
  float astray;   // s, too far from the setpoint or too fast
  float stalled;  // s at the limit of current without motion
} gc_motor;

#define GC_MOTORS_MOST 8u

// +1 or -1: sign of the current that pulls the cable in.
int32_t gc_motor_direction(const gc_parameters *parameters, uint32_t index);

// Counts in the direction that pulls in, from the zero position; from angle 0 of the first turn while that is unknown.
int32_t gc_motor_counts(const gc_motor *motor, const gc_parameters *parameters, uint32_t index);

// Displacement (m) from the zero position; from angle 0 of the first turn while that is unknown.
float gc_motor_displacement(const gc_motor *motor, const gc_parameters *parameters, uint32_t index);

// Velocity (m/s).
float gc_motor_velocity(const gc_motor *motor, const gc_parameters *parameters, uint32_t index);

// The last clamp: `wanted` (mA) within the limit of current, of heat and of the stroke.
int16_t gc_motor_clamp(gc_motor *motor, const gc_parameters *parameters, uint32_t index);

// Warm the winding by the current that is sent, for `dt` s.
void gc_motor_warm(gc_motor *motor, const gc_parameters *parameters, float dt);

// Start the loop at rest where the cable is, with the current that is sent.
void gc_motor_hold(gc_motor *motor, const gc_parameters *parameters, uint32_t index);

// Step the loop by `dt` s toward the target at no more than `fastest` (m/s); sets `wanted`.
void gc_motor_drive(gc_motor *motor, const gc_parameters *parameters, uint32_t index, float dt, float fastest);

// The same within the limit of velocity; a motor that only pulls takes up the backlash of its gear where the target rests.
void gc_motor_follow(gc_motor *motor, const gc_parameters *parameters, uint32_t index, float dt);

// Let the motors of the mask `present` that only pull take up their backlash at the same time: once all targets stay and one is due.
void gc_motors_act_together(gc_motor *motors, const gc_parameters *parameters, uint32_t present);

// Whether the motor stalls or runs away while the board drives it; `dt` s since the last look.
bool gc_motor_is_astray(gc_motor *motor, const gc_parameters *parameters, uint32_t index, float dt);

#endif
