// How noisy the samples of a sensor are while it vibrates (src/gravcomp/orientation/vibration.py).
#ifndef GC_VIBRATION_H
#define GC_VIBRATION_H

#include <stdbool.h>
#include <stdint.h>

#define GC_LAST_MEANS 4u

// Means of one sample, of two, of four, ...: an array of these. Zero is the state before the first sample.
typedef struct {
  bool waits;                    // for its neighbour
  float waiting[3];              // the mean that waits
  uint32_t known;                // of the last means
  float last[GC_LAST_MEANS][3];  // the oldest first
  float density;                 // of the noise on each axis, in the square of the unit per Hz
} gc_vibration;

// Forget the samples, not the noise: what follows is no continuation of them. kinds: length of the array.
void gc_vibration_interrupt(gc_vibration *vibration, uint32_t kinds);

// Take a sample (3,), dt s after the last one.
void gc_vibration_take(gc_vibration *vibration, uint32_t kinds, float dt, const float *value);

// Return the density of the noise that a sum of the samples has.
float gc_vibration_density(const gc_vibration *vibration, uint32_t kinds);

// Return the variance of a single sample on each axis, with the period in s between two of them.
float gc_vibration_variance(const gc_vibration *vibration, float period);

#endif
