// Spikes: single samples of a sensor that belong to no motion (src/gravcomp/orientation/spikes.py).
#ifndef GC_SPIKES_H
#define GC_SPIKES_H

#include <stdbool.h>
#include <stdint.h>

#include "settings.h"

#define GC_SUSPECTS_MAX 10u  // largest value of the option `longest`

typedef struct {
  float floor;     // a smaller jump is no spike
  float sure;      // of the threshold: what is nearer to the straight line counts as it is
  float patience;  // factor of the option `ratio`: more where a later look finds what is overlooked here
  bool started;
  float last[3], slope[3];
  float mean;
  uint32_t suspects;  // number of the last samples that are not decided
  float pending[GC_SUSPECTS_MAX][3];
  bool clear;
} gc_spike_gate;

// Forget the signal: the next sample is good.
void gc_spike_gate_reset(gc_spike_gate *gate);

// Replace the value (3,) of a sample `dt` s after the last one by the one to use. Returns for how many suspects before it this
// sample decides; `counted` (GC_SUSPECTS_MAX, 3) then has what counts for each of them.
uint32_t gc_spike_gate_take(gc_spike_gate *gate, const gc_settings *settings, float dt, float *value,
                            float (*counted)[3]);

#endif
