// What a sensor likely turned while samples were missing (src/gravcomp/orientation/missing_rates.py).
#ifndef GC_MISSING_RATES_H
#define GC_MISSING_RATES_H

#include <stdint.h>

#define GC_KNOWN_RATES 3u

// A motion: variance of its rate on each axis, (rad/s)^2, and the angular frequency of its swings, rad/s.
typedef struct {
  float variance, frequency;
} gc_swing;

// Write the weights in s of known rates for the angle turned from 0 to gap s; return its variance on each axis, rad^2.
// swings (count,): independent parts of the motion; times in s and noise in (rad/s)^2 of the known rates.
float gc_likeliest_turn(const gc_swing *swings, uint32_t count, const float *times, const float *noise, float gap,
                        float *weights);

#endif
