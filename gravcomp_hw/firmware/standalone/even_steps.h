// Steps of time from stamps that jitter (src/gravcomp/orientation/even_steps.py).
#ifndef GC_EVEN_STEPS_H
#define GC_EVEN_STEPS_H

// Zero is the state before the first step of a stream.
typedef struct {
  float period;  // s, mean
  float jitter;  // mean square of the steps' distance from the period, of the period
  float longer;  // share of steps in which samples are missing
  float ahead;   // s, of the stamps that is not counted yet
} gc_even_steps;

// Return the step in s that counts for one of `dt` s > 0 between two stamps.
float gc_even_steps_take(gc_even_steps *even, float dt);

#endif
