// Orientation from gyroscope and accelerometer: the error-state Kalman filter of src/gravcomp/orientation/filter.py.
#ifndef GC_ORIENTATION_H
#define GC_ORIENTATION_H

#include "alignment.h"
#include "error_covariance.h"
#include "even_steps.h"
#include "rest.h"
#include "sample_check.h"
#include "spike_review.h"
#include "spikes.h"
#include "swings.h"

#define GC_FORCE_MEANS 3u // kinds of means of the specific force whose noise is measured
#define GC_STEPS_MAX GC_SUSPECTS_MAX // last steps that a decision about a spike may change; at least GC_REVIEW_AHEAD

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
  gc_alignment alignment;
  gc_swings swings;                        // of the rate
  gc_vibration vibration[GC_FORCE_MEANS];  // of the specific force
} gc_filter_state;

// What the filter takes of a sample.
typedef struct {
  float dt, gyro[3], accel[3];
  bool gyro_usable, accel_usable;
  float doubt;  // rad/s: by how much the measured rate differs from the one that counts until the next samples decide
} gc_filter_step;

// A step that a later sample may change.
typedef struct {
  gc_filter_state before;
  gc_filter_step step;
} gc_kept_step;

typedef struct {
  const gc_settings *settings;
  bool started, contradicted, temperature_stable;
  gc_filter_state state;
  gc_sample_check check;
  gc_even_steps even;
  gc_spike_gate gyro_gate, accel_gate;
  gc_spike_review gyro_review, accel_review;
  uint32_t kept_count, kept_next;
  gc_kept_step kept[GC_STEPS_MAX];  // a ring: the last one is before kept_next
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
