#include "spikes.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_BOUND 0.5f
#define GC_NEARER 2.0f
#define GC_FAR 2.0f
#define GC_CLEAR 3.0f

void gc_spike_gate_reset(gc_spike_gate *gate) {
  gate->started = false;
  gate->mean = 0.0f;
  gate->suspects = 0;
  gc_zero(gate->slope, sizeof gate->slope);
}

static float from_suspect(const gc_spike_gate *gate, const float *value) {
  const float *suspect = gate->pending[gate->suspects - 1u];
  float largest = 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    largest = gc_max(largest, gc_abs(value[i] - suspect[i]));
  }
  return largest;
}

// Accept the value, and the values that count for the suspects; return their number.
static uint32_t decide(gc_spike_gate *gate, const float *value, float (*counted)[3]) {
  const uint32_t count = gate->suspects;
  for (uint32_t i = 0; i < 3u; ++i) {
    gate->slope[i] = value[i] - counted[count - 1u][i];
    gate->last[i] = value[i];
  }
  gate->suspects = 0;
  return count;
}

// Count the straight line in place of the suspects that are far from it: they were spikes.
static uint32_t returned(gc_spike_gate *gate, const float *value, float threshold, float (*counted)[3]) {
  for (uint32_t k = 0; k < gate->suspects; ++k) {
    const float part = (float)(k + 1u) / (float)(gate->suspects + 1u);
    float line[3], away = 0.0f;
    for (uint32_t i = 0; i < 3u; ++i) {
      line[i] = gate->last[i] + (value[i] - gate->last[i]) * part;
      away = gc_max(away, gc_abs(gate->pending[k][i] - line[i]));
    }
    gc_copy(counted[k], away > gate->sure * threshold ? line : gate->pending[k], sizeof line);
  }
  return decide(gate, value, counted);
}

uint32_t gc_spike_gate_take(gc_spike_gate *gate, const gc_settings *settings, float dt, float *value,
                            float (*counted)[3]) {
  const uint32_t longest = (uint32_t)gc_clamp(settings->spike_longest, 1.0f, (float)GC_SUSPECTS_MAX);
  if (!gate->started) {
    gate->started = true;
    gc_copy(gate->last, value, sizeof gate->last);
    return 0;
  }
  const float steps = (float)(gate->suspects + 1u);
  float jump = 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    const float difference = value[i] - gate->last[i];
    jump = gc_max(jump, gc_min(gc_abs(difference), gc_abs(difference - steps * gate->slope[i])));
  }
  const float threshold = gc_max(gate->floor, gate->patience * settings->spike_ratio * gate->mean);
  const float bounded = gc_min(jump, GC_BOUND / gate->patience * threshold);
  gate->mean += dt / (settings->spike_time_constant + dt) * (bounded - gate->mean);
  if (gate->suspects == 0u) {
    if (jump <= threshold) {
      for (uint32_t i = 0; i < 3u; ++i) {
        gate->slope[i] = value[i] - gate->last[i];
        gate->last[i] = value[i];
      }
      return 0;
    }
    gate->clear = jump > GC_CLEAR * threshold;
  } else {
    const float away = from_suspect(gate, value);
    if (jump <= GC_FAR * (steps * threshold) && GC_NEARER * jump <= away) {
      return returned(gate, value, threshold, counted);
    }
    if (gate->suspects >= longest || (!gate->clear && GC_NEARER * away <= gc_max(jump, threshold))) {
      gc_copy(counted, gate->pending, sizeof(float[3]) * gate->suspects);
      return decide(gate, value, counted);
    }
  }
  gc_copy(gate->pending[gate->suspects++], value, sizeof(float[3]));
  for (uint32_t i = 0; i < 3u; ++i) {
    value[i] = gate->last[i] + gate->slope[i];
  }
  return 0;
}
