// The loop on the board as a shared library: the caller gives the memory, the blob, samples or gravity.
#ifndef GC_LOOP_H
#define GC_LOOP_H

#include "../../standalone/standalone.h"

// What the loop computed.
typedef struct {
  float gravity[3];   // m/s^2, soft_base
  float turning[3];   // m/s^2, soft_base, what turns of the base add
  float tip[3];       // m, of the model
  float displacement[GC_CABLES_MAX];  // m
  float tension[GC_CABLES_MAX];       // N
  float left;         // m
  uint32_t code;
  uint32_t converged;
  uint32_t solver_steps;
  uint32_t cables;
} gc_loop_result;

// Bytes of a loop, and number of floats of its settings.
size_t gc_loop_size(void);
size_t gc_loop_settings(void);

// Take a model; returns why it is refused, 0: it is taken. The memory is zero before the first call.
uint32_t gc_loop_load(gc_standalone *loop, const uint8_t *blob, size_t size);

// Estimate gravity from a sample: stamp in us, gyro (3,) in rad/s, accel (3,) in m/s^2. Returns false where it cannot be used.
bool gc_loop_weigh(gc_standalone *loop, int64_t stamp, const float *gyro, const float *accel);

// Go to the gravity that was estimated last, with what turns of the base add, or to `gravity` (3,) in m/s^2. Returns whether there is a command.
bool gc_loop_follow(gc_standalone *loop, const float *gravity, float interval);

// Set the joystick to x and y, -1 to 1, in place of the stored target.
void gc_loop_joystick(gc_standalone *loop, float x, float y);

// Read the last results.
void gc_loop_read(const gc_standalone *loop, gc_loop_result *result);

#endif
