// Covariance of the orientation filter's error state (src/gravcomp/orientation/error_covariance.py): rotation in the earth's
// frame, gyroscope bias in the sensor's, velocity in the earth's.
//
// The measurements are single components with independent noise, so each is taken by itself: no matrix is inverted.
#ifndef GC_ERROR_COVARIANCE_H
#define GC_ERROR_COVARIANCE_H

#include <stdbool.h>

#include "quaternion.h"

#define GC_ERRORS 9u

typedef struct {
  float matrix[GC_ERRORS][GC_ERRORS];
} gc_error_covariance;

// Variances that a step adds on each axis: rad^2, (rad/s)^2, (m/s)^2.
typedef struct {
  float tilt, bias, velocity;
} gc_step_noise;

// Set the standard deviation of the bias in rad/s on each axis and remove its correlations.
void gc_covariance_set_bias(gc_error_covariance *covariance, float std);

// Set the standard deviations of the inclination in rad and of the velocity in m/s and remove their correlations. What remains is
// `together`: that of each horizontal velocity with the inclination by which gravity causes it.
void gc_covariance_set_tilt_and_velocity(gc_error_covariance *covariance, float tilt, float velocity, float together);

// Predict over dt s with the orientation in the middle of the step. gravity in m/s^2; with_bias: the error of the bias acts.
void gc_covariance_predict(gc_error_covariance *covariance, float dt, gc_quaternion middle, float gravity, gc_step_noise noise,
                           bool with_bias);

// Correct by 'the velocity is zero' with the variance in (m/s)^2; write the error state (9,).
void gc_covariance_correct_velocity(gc_error_covariance *covariance, const float *velocity, float variance,
                                    gc_quaternion orientation, float *error);

// Correct by 'the velocity is zero' and 'the mean rate is the bias'; bias_residual (3,) in rad/s: mean rate minus bias.
void gc_covariance_correct_at_rest(gc_error_covariance *covariance, const float *velocity, const float *bias_residual,
                                   float velocity_variance, float bias_variance, float *error);

#endif
