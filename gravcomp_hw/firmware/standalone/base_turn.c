#include "base_turn.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_STALE 10.0f  // periods between rates, after which the last one says nothing

// Return the time in s from the last rate to a stamp, 0 where the last rate says nothing about it.
static float since_rate(const gc_base_turn *turn, const gc_settings *settings, int64_t stamp) {
  const int64_t passed = stamp - turn->stamp, longest = gc_round(1e6f * GC_STALE * settings->period);
  return turn->has_rate && passed > 0 && passed <= longest ? (float)(int32_t)passed * 1e-6f : 0.0f;
}

void gc_base_turn_acting(const gc_base_turn *turn, const gc_settings *settings, int64_t stamp, float *field) {
  const bool fresh = since_rate(turn, settings, stamp) > 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    field[i] = fresh ? turn->acting[i] : 0.0f;
  }
}

void gc_base_turn_follow(gc_base_turn *turn, const gc_settings *settings, int64_t stamp, const float *rate) {
  const float interval = since_rate(turn, settings, stamp), height = settings->turn_height;
  float *w = turn->rate, *acting = turn->acting;
  turn->has_rate = true;
  turn->stamp = stamp;
  if (!(interval > 0.0f)) {
    gc_copy(w, rate, sizeof turn->rate);
    gc_zero(acting, sizeof turn->acting);
    return;
  }
  const float share = interval / (interval + settings->turn_time), per_second = share / interval;
  float change[3];  // rad/s^2
  for (uint32_t i = 0; i < 3u; ++i) {
    change[i] = per_second * (rate[i] - w[i]);
    w[i] += share * (rate[i] - w[i]);
  }
  // - a x r - w x (w x r) at r = (0, 0, height)
  acting[0] = height * (-change[1] - w[0] * w[2]);
  acting[1] = height * (change[0] - w[1] * w[2]);
  acting[2] = height * (w[0] * w[0] + w[1] * w[1]);
}
