// Homing: each cable is wound in until it is taut; the knee of its current over position is its zero position.
//
//     i(x) = i_0 + s max(0, x - x_0), fitted by least squares as gravcomp.motors.homing does
//
// The fit takes one candidate x_0 for each tick, so that no tick is long.
#ifndef GC_HOMING_H
#define GC_HOMING_H

#include <stdbool.h>
#include <stdint.h>

#include "motor.h"

#define GC_HOMING_SAMPLES 256u

typedef enum { GC_SLACKEN, GC_WIND, GC_FIT, GC_RELAX, GC_TO_ZERO, GC_HOMED, GC_HOMING_FAILED } gc_homing_phase;

typedef struct {
  float position;  // m
  float current;   // A
} gc_homing_sample;

typedef struct {
  gc_homing_phase phase;
  uint32_t motor;  // that winds
  float since;     // s in this phase
  float from;      // m, where the winding began
  gc_homing_sample samples[GC_HOMING_SAMPLES];
  uint32_t count;
  uint32_t stride;  // every stride-th step is sampled
  uint32_t skipped;
  float smooth;    // A
  float baseline;  // A, of the slack cable
  uint32_t baseline_steps;
  float risen;  // s above the threshold
  float low;    // m, range of candidates
  float high;
  uint32_t candidate;
  uint32_t refinements;
  float knee;   // m, the best candidate
  float cost;   // A^2
  float zeros[GC_MOTORS_MOST];  // m, in the displacement before homing
} gc_homing;

// Begin: all cables are paid out first.
void gc_homing_start(gc_homing *homing, gc_motor *motors, const gc_parameters *parameters, uint8_t present);

// One step of `dt` s: sets the targets of the motors. At the end the zero positions are set.
void gc_homing_step(gc_homing *homing, gc_motor *motors, const gc_parameters *parameters, uint8_t present, float dt);

#endif
