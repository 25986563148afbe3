// Second look at the samples of a sensor, some samples later: each one between its neighbours on both sides
// (src/gravcomp/orientation/spike_review.py).
#ifndef GC_SPIKE_REVIEW_H
#define GC_SPIKE_REVIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "settings.h"

#define GC_REVIEW_BEFORE 5u // samples of the fit before and after the one in question
#define GC_REVIEW_AHEAD 4u
#define GC_REVIEW_SAMPLES (GC_REVIEW_BEFORE + 1u + GC_REVIEW_AHEAD)

typedef struct {
  float floor;  // a smaller distance is no spike
  float sure;   // of the threshold: from here a sample that is far from a curve is one
  uint32_t count;
  float samples[GC_REVIEW_SAMPLES][3];
  float mean, mean_from_median, bend;
} gc_spike_review;

// Forget the samples: what follows is no continuation of them.
void gc_spike_review_reset(gc_spike_review *review);

// Take the value (3,) of a sample `dt` s after the last one, and write what counts for the one GC_REVIEW_AHEAD samples before it
// into `counted` (3,). Returns false while there are too few samples for a decision.
bool gc_spike_review_take(gc_spike_review *review, const gc_settings *settings, float dt, const float *value, float *counted);

#endif
