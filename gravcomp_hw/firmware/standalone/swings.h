// How fast the rates of a sensor swing, and by how much it may have turned in a gap (src/gravcomp/orientation/swings.py).
#ifndef GC_SWINGS_H
#define GC_SWINGS_H

#include "vibration.h"

// Rates are without bias. Zero is the state before the first sample.
typedef struct {
  float turning, changing;  // mean squares of the rate and of the smoothed rate's change, (rad/s)^2 and (rad/s^2)^2
  float change, bend;       // mean squares of the first and second derivative of the rate, (rad/s^2)^2 and (rad/s^3)^2
  float smooth[3];          // rad/s
  uint32_t known;           // of the next two: 0, 1 or both
  float last[3], slope[3];  // the last rate and its change, rad/s and rad/s^2
  gc_vibration noise;
} gc_swings;

// Forget the last samples, not how they swing: what follows is no continuation of them.
void gc_swings_interrupt(gc_swings *swings);

// Follow the rate (3,) in rad/s over dt s.
void gc_swings_watch(gc_swings *swings, float dt, const float *rate);

// Return by how much (rad) the sensor may have turned in a gap (s) other than the rates around it (rad/s) show. period: s between
// two samples.
float gc_swings_missed_in(const gc_swings *swings, float gap, float period, float rate_before, float rate_after);

#endif
