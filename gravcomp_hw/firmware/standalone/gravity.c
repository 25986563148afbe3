#include "gravity.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_STABLE_TIME 20000000  // us
#define GC_STABLE_SPAN 0.13f     // degC

void gc_gravity_reset(gc_gravity_estimator *estimator, const gc_settings *settings) {
  gc_zero(estimator, sizeof *estimator);
  estimator->settings = settings;
  estimator->mount =
      (gc_quaternion){settings->mount[0], settings->mount[1], settings->mount[2], settings->mount[3]};
  gc_orientation_reset(&estimator->filter, settings);
}

void gc_gravity_temperature(gc_gravity_estimator *estimator, int64_t stamp, float temperature) {
  if (!gc_finite(temperature)) {
    return;
  }
  estimator->coldest = estimator->has_temperature ? gc_min(estimator->coldest, temperature) : temperature;
  estimator->warmest = estimator->has_temperature ? gc_max(estimator->warmest, temperature) : temperature;
  if (!estimator->has_temperature || estimator->warmest - estimator->coldest > GC_STABLE_SPAN || stamp < estimator->since) {
    estimator->coldest = estimator->warmest = temperature;
    estimator->since = stamp;
  }
  estimator->has_temperature = true;
  estimator->filter.temperature_stable = stamp - estimator->since >= GC_STABLE_TIME;
}

// Follow the rate (3,) in rad/s and its trend.
static void follow(gc_gravity_estimator *estimator, int64_t stamp, const float *rate) {
  if (estimator->has_rate && stamp > estimator->stamp) {
    const int64_t step = stamp - estimator->stamp;
    const float dt = (float)(step < 1000000000 ? (int32_t)step : 1000000000) * 1e-6f;
    const float gain = 1.0f / (estimator->settings->trend_time + dt);
    for (uint32_t i = 0; i < 3u; ++i) {
      estimator->trend[i] += gain * ((rate[i] - estimator->rate[i]) - estimator->trend[i] * dt);
    }
  }
  estimator->has_rate = true;
  estimator->stamp = stamp;
  gc_copy(estimator->rate, rate, sizeof estimator->rate);
}

// Return the orientation one horizon after the last sample.
static gc_quaternion ahead(const gc_gravity_estimator *estimator, gc_quaternion orientation) {
  const float horizon = estimator->settings->horizon;
  if (!(horizon > 0.0f)) {
    return orientation;
  }
  const float lasting = gc_min(estimator->settings->longest_trend, horizon), weight = lasting * (horizon - 0.5f * lasting);
  float turn[3];
  for (uint32_t i = 0; i < 3u; ++i) {
    turn[i] = estimator->rate[i] * horizon + estimator->trend[i] * weight;
  }
  return gc_quaternion_normalised(gc_quaternion_product(orientation, gc_quaternion_exponential(turn[0], turn[1], turn[2])));
}

bool gc_gravity_take(gc_gravity_estimator *estimator, int64_t stamp, const float *gyro, const float *accel, float *gravity) {
  const gc_settings *s = estimator->settings;
  float rate[3], force[3];
  for (uint32_t i = 0; i < 3u; ++i) {
    rate[i] = gyro[i] - s->gyro_offset[i];
    force[i] = s->accel_scale[i] * (accel[i] - s->accel_offset[i]);
  }
  gc_orientation_estimate estimate;
  if (!gc_orientation_take(&estimator->filter, stamp, rate, force, &estimate)) {
    return false;
  }
  follow(estimator, stamp, estimate.rate);
  const float down[3] = {0.0f, 0.0f, -s->gravity};
  gc_quaternion_rotate(gc_quaternion_conjugate(ahead(estimator, estimate.orientation)), down, gravity);
  gc_quaternion_rotate(estimator->mount, gravity, gravity);
  return true;
}
