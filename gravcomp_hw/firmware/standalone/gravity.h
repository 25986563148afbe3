// Raw IMU samples to gravity in the frame of the robot's base (src/gravcomp/orientation/estimator.py and prediction.py).
#ifndef GC_GRAVITY_H
#define GC_GRAVITY_H

#include "orientation.h"

typedef struct {
  const gc_settings *settings;
  gc_orientation filter;
  gc_quaternion mount;
  bool has_rate;
  int64_t stamp;             // us, of the last rate
  float rate[3], trend[3];   // rad/s, rad/s^2
  bool has_temperature;
  float coldest, warmest;    // degC
  int64_t since;             // us, when the readings began to stay within one count of the chip
} gc_gravity_estimator;

// Start with yaw 0 and no bias.
void gc_gravity_reset(gc_gravity_estimator *estimator, const gc_settings *settings);

// Take a temperature in degC: while it is stable the bias hardly walks.
void gc_gravity_temperature(gc_gravity_estimator *estimator, int64_t stamp, float temperature);

// Take a raw sample with the stamp in us, gyro (3,) in rad/s, accel (3,) in m/s^2, and write gravity (3,) in m/s^2 in soft_base,
// one horizon after the stamp. Returns false where the sample cannot be used; gravity is not written then.
bool gc_gravity_take(gc_gravity_estimator *estimator, int64_t stamp, const float *gyro, const float *accel, float *gravity);

#endif
