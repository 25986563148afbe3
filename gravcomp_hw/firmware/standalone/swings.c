#include "swings.h"

#include "../core/maths.h"
#include "../core/memory.h"
#include "missing_rates.h"

#define GC_MEMORY 1.0f      // s
#define GC_SMOOTHING 0.05f  // s
#define GC_UNEVEN 2.0f      // square of the frequency, of that of a rate that changes evenly in a gap

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

float gc_swings_across(const gc_swings *swings, float gap, float period, const float *after, float doubt, float *mean) {
  const float noise = gc_vibration_variance(&swings->noise, period), often = 1.0f / squared(period);
  const float turning = gc_max(0.0f, swings->turning - 3.0f * noise);
  const float changing = gc_max(0.0f, swings->changing - 3.0f * noise / squared(GC_SMOOTHING + period));
  const float *smooth = swings->known > 0u ? swings->smooth : after, *before = swings->known > 0u ? swings->last : after;
  // The sensor may have begun to move in the gap.
  const float most = gc_max(turning, gc_max(square_of(before), square_of(after)));
  if (!(most > 0.0f)) {
    gc_copy(mean, after, 3u * sizeof *mean);
    return 0.0f;
  }
  float difference[3];
  for (uint32_t i = 0; i < 3u; ++i) {
    difference[i] = before[i] - after[i];
  }
  const float swung = GC_UNEVEN * square_of(difference) / (gap * gap) / most;
  const float slow = turning > 0.0f ? changing / turning : 0.0f;
  const float least = 1.0f / squared(GC_MEMORY);  // slower ones do not show in the memory
  gc_swing parts[2] = {{most / 3.0f, gc_sqrt(gc_max(least, gc_max(slow, swung)))}, {0.0f, 1.0f}};
  const float change = gc_max(0.0f, swings->change - 6.0f * noise * often);
  const float bend = gc_max(0.0f, swings->bend - 18.0f * noise * (often * often));
  const bool trembles = change > 0.0f && bend > 0.0f;
  if (trembles) {
    parts[1].variance = change / (3.0f * bend) * change;
    parts[1].frequency = gc_sqrt(bend / change);
  }
  // A rate is the mean of the period before it; smoothed, it is as late as the smoothing is long.
  const float times[GC_KNOWN_RATES] = {-GC_SMOOTHING - 0.5f * period, -0.5f * period, gap - 0.5f * period};
  const float noises[GC_KNOWN_RATES] = {noise, noise, noise + doubt * doubt};
  float weights[GC_KNOWN_RATES];
  const float variance = gc_likeliest_turn(parts, trembles ? 2u : 1u, times, noises, gap, weights);
  for (uint32_t i = 0; i < 3u; ++i) {
    mean[i] = ((weights[0] * smooth[i] + weights[1] * before[i]) + weights[2] * after[i]) / gap;
  }
  return variance;
}
