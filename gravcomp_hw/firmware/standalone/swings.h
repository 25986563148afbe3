// How fast the rates of a sensor swing, and what it likely turned in a gap (src/gravcomp/orientation/swings.py).
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

// Write the likeliest mean rate (3,) in a gap of `gap` s, rad/s; return the variance of the angle turned, rad^2 on each axis.
// period: s between two samples; after (3,): the rate after the gap, and doubt: its error beyond noise, rad/s.
float gc_swings_across(const gc_swings *swings, float gap, float period, const float *after, float doubt, float *mean);

#endif
