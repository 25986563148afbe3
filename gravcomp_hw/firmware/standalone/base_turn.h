// What a turn of the base adds to gravity (src/gravcomp/external_loads/base_turn.py): d'Alembert's forces as one field.
#ifndef GC_BASE_TURN_H
#define GC_BASE_TURN_H

#include <stdbool.h>
#include <stdint.h>

#include "settings.h"

// State; zeros before the first rate.
typedef struct {
  bool has_rate;
  int64_t stamp;    // us, of the last rate
  float rate[3];    // rad/s in soft_base, after the low-pass
  float acting[3];  // m/s^2 in soft_base
} gc_base_turn;

// Write what adds to gravity, field (3,) in m/s^2 in soft_base, at `stamp` in us: zeros without a fresh rate from before.
void gc_base_turn_acting(const gc_base_turn *turn, const gc_settings *settings, int64_t stamp, float *field);

// Go on to the rate (3,) in rad/s in soft_base at `stamp` in us; after a gap, and where time runs backwards, it begins again.
void gc_base_turn_follow(gc_base_turn *turn, const gc_settings *settings, int64_t stamp, const float *rate);

#endif
