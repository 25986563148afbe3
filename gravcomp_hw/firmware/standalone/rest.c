#include "rest.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_CONSISTENT_SIGMAS 4.0f
#define GC_CONSISTENT_FLOOR 2.617993878e-3f  // rad/s

static float consistent_within(float bias_std) { return GC_CONSISTENT_SIGMAS * bias_std + GC_CONSISTENT_FLOOR; }

// Whether a time in us is at least that for which the conditions of rest must hold.
static bool lasted(uint32_t time, const gc_settings *settings) {
  return (int32_t)time >= gc_round(1e6f * settings->rest_minimum_time);
}

bool gc_rest_calm(const gc_rest *rest, const gc_settings *settings) { return lasted(rest->calm, settings); }

// Return the sum of two times in us, held below what wraps.
static uint32_t longer(uint32_t time, uint32_t passed) { return time < 1000000000u ? time + passed : time; }

bool gc_rest_take(gc_rest *rest, const gc_settings *settings, float dt, const float *gyro, const float *accel,
                  const float *bias, const float *bias_std) {
  if (!rest->started) {
    gc_zero(rest, sizeof *rest);
    rest->started = true;
    gc_copy(rest->mean_gyro, gyro, sizeof rest->mean_gyro);
    gc_copy(rest->mean_accel, accel, sizeof rest->mean_accel);
    gc_copy(rest->reference, accel, sizeof rest->reference);
    gc_copy(rest->calm_reference, accel, sizeof rest->calm_reference);
    return false;
  }
  const float gain = dt / (settings->rest_time_constant + dt);
  bool still = true, calm = true;
  for (uint32_t i = 0; i < 3u; ++i) {
    const float turning = gyro[i] - rest->mean_gyro[i], shaking = accel[i] - rest->mean_accel[i];
    rest->mean_gyro[i] += gain * turning;
    rest->mean_accel[i] += gain * shaking;
    const float mean = rest->mean_gyro[i];
    if (gc_abs(turning) > settings->rest_gyro_deviation || gc_abs(shaking) > settings->rest_accel_deviation ||
        gc_abs(mean) > settings->rest_largest_bias) {
      still = calm = false;
    } else if (gc_abs(mean - bias[i]) > consistent_within(bias_std[i]) ||
               gc_abs(rest->mean_accel[i] - rest->reference[i]) > settings->rest_accel_drift) {
      still = false;
    }
    if (gc_abs(rest->mean_accel[i] - rest->calm_reference[i]) > settings->rest_accel_drift) {
      calm = false;
    }
  }
  const uint32_t passed = (uint32_t)gc_round(1e6f * dt);
  rest->calm = calm ? longer(rest->calm, passed) : 0u;
  rest->still = still ? longer(rest->still, passed) : 0u;
  if (!calm) {
    gc_copy(rest->calm_reference, rest->mean_accel, sizeof rest->calm_reference);
  }
  if (!still) {
    gc_copy(rest->reference, rest->mean_accel, sizeof rest->reference);
  }
  return lasted(rest->still, settings);
}
