#include "swings.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_MEMORY 1.0f      // s
#define GC_SMOOTHING 0.05f  // s

static float squared(float x) { return x * x; }

static float square_of(const float *v) { return (v[0] * v[0] + v[1] * v[1]) + v[2] * v[2]; }

void gc_swings_interrupt(gc_swings *swings) {
  gc_vibration_interrupt(&swings->noise, 1u);
  swings->known = 0;
}

void gc_swings_watch(gc_swings *swings, float dt, const float *rate) {
  gc_vibration_take(&swings->noise, 1u, dt, rate);
  const float gain = dt / (GC_MEMORY + dt), slower = 1.0f / (GC_SMOOTHING + dt), faster = 1.0f / dt;
  float change[3], slope[3], bend[3];
  for (uint32_t i = 0; i < 3u; ++i) {
    change[i] = (rate[i] - swings->smooth[i]) * slower;
    swings->smooth[i] += change[i] * dt;
    slope[i] = (rate[i] - swings->last[i]) * faster;
    bend[i] = (slope[i] - swings->slope[i]) * faster;
  }
  swings->turning += gain * (square_of(rate) - swings->turning);
  swings->changing += gain * (square_of(change) - swings->changing);
  if (swings->known > 0u) {
    swings->change += gain * (square_of(slope) - swings->change);
    for (uint32_t i = 0; i < 3u; ++i) {
      swings->slope[i] = slope[i];
    }
  }
  if (swings->known > 1u) {
    swings->bend += gain * (square_of(bend) - swings->bend);
  }
  swings->known += swings->known < 2u ? 1u : 0u;
  gc_copy(swings->last, rate, sizeof swings->last);
}

// Return the part of an angle that a gap t hides, (f t)^2 / 12 and at most half, with (f t)^2 = swing / of.
static float missed(float swing, float of, float angle) { return angle * (swing < 6.0f * of ? swing / (12.0f * of) : 0.5f); }

float gc_swings_missed_in(const gc_swings *swings, float gap, float period, float rate_before, float rate_after) {
  const float noise = 3.0f * gc_vibration_variance(&swings->noise, period), often = 1.0f / squared(period);
  const float turning = gc_max(0.0f, swings->turning - noise);
  const float changing = gc_max(0.0f, swings->changing - noise / squared(GC_SMOOTHING + period));
  const float change = gc_max(0.0f, swings->change - 2.0f * noise * often);
  const float bend = gc_max(0.0f, swings->bend - 6.0f * noise * (often * often));
  const float slow = missed(gap * gap * changing, turning, gap * gc_max(gc_sqrt(turning), gc_max(rate_before, rate_after)));
  const float fast = bend > 0.0f ? missed(gap * gap * bend, change, gap * change / gc_sqrt(bend)) : 0.0f;
  return gc_sqrt(slow * slow + fast * fast);
}
