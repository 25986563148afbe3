// Detection of rest, at which the mean rate is the bias (src/gravcomp/orientation/rest.py).
#ifndef GC_REST_H
#define GC_REST_H

#include <stdbool.h>
#include <stdint.h>

#include "settings.h"

typedef struct {
  bool started;
  float mean_gyro[3];   // rad/s
  float mean_accel[3];  // m/s^2
  float reference[3], calm_reference[3];
  uint32_t still, calm;  // us: whole numbers, so that the conditions hold from the same sample on as on the host
} gc_rest;

// Take a sample `dt` s after the last one, and return whether the sensor rests. gyro, bias, bias_std (3,) in rad/s; accel (3,) in
// m/s^2.
bool gc_rest_take(gc_rest *rest, const gc_settings *settings, float dt, const float *gyro, const float *accel,
                  const float *bias, const float *bias_std);

// Whether the sensor rests or turns slowly about the vertical.
bool gc_rest_calm(const gc_rest *rest, const gc_settings *settings);

#endif
