// Orientation from gyroscope and accelerometer: the error-state Kalman filter of src/gravcomp/orientation/filter.py.
#ifndef GC_ORIENTATION_H
#define GC_ORIENTATION_H

#include "error_covariance.h"
#include "rest.h"
#include "sample_check.h"
#include "spikes.h"

#define GC_UNDECIDED_MAX (2u * GC_SUSPECTS_MAX + 2u)

// What a sample changes.
typedef struct {
  gc_quaternion orientation;  // sensor to earth
  float velocity[3];          // m/s, earth
  float bias[3];              // rad/s
  float last_gyro[3];         // rad/s
  float period;               // s, mean; 0 at the start
  float gravity_norm;         // m/s^2
  float norm_at_rest;         // m/s^2, 0 before the first rest
  gc_error_covariance errors;
  gc_rest rest;
} gc_filter_state;

// A sample whose spikes are not decided yet.
typedef struct {
  float dt, gyro[3], accel[3];
  bool gyro_usable, accel_usable;
} gc_filter_step;

typedef struct {
  const gc_settings *settings;
  bool started, contradicted, temperature_stable;
  gc_filter_state state;
  gc_sample_check check;
  gc_spike_gate gyro_gate, accel_gate;
  bool suspecting;        // `before` is the state before the first sample that is not decided
  gc_filter_state before;
  uint32_t undecided_count;
  gc_filter_step undecided[GC_UNDECIDED_MAX];
} gc_orientation;

// Result of a sample.
typedef struct {
  gc_quaternion orientation;  // at the stamp, the sensor's delay compensated
  float rate[3];              // rad/s, without bias
} gc_orientation_estimate;

// Start without orientation; the first sample gives the inclination.
void gc_orientation_reset(gc_orientation *filter, const gc_settings *settings);

// Take a sample with the stamp in us, gyro (3,) in rad/s, accel (3,) in m/s^2. Returns false where it cannot be used;
// nothing is written then.
bool gc_orientation_take(gc_orientation *filter, int64_t stamp, const float *gyro, const float *accel,
                         gc_orientation_estimate *estimate);

#endif
