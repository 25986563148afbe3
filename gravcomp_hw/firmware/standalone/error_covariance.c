#include "error_covariance.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define BIAS 3u      // first component of the bias
#define VELOCITY 6u  // and of the velocity
#define YAW 2u

void gc_covariance_set_bias(gc_error_covariance *covariance, float std) {
  float(*p)[GC_ERRORS] = covariance->matrix;
  for (uint32_t i = BIAS; i < VELOCITY; ++i) {
    for (uint32_t k = 0; k < GC_ERRORS; ++k) {
      p[i][k] = p[k][i] = 0.0f;
    }
    p[i][i] = std * std;
  }
}

void gc_covariance_set_tilt_and_velocity(gc_error_covariance *covariance, float tilt, float velocity, float together) {
  float(*p)[GC_ERRORS] = covariance->matrix;
  for (uint32_t i = 0; i < GC_ERRORS; ++i) {
    if (i < 2u || i >= VELOCITY) {
      for (uint32_t k = 0; k < GC_ERRORS; ++k) {
        p[i][k] = p[k][i] = 0.0f;
      }
      p[i][i] = i < 2u ? tilt * tilt : velocity * velocity;
    }
  }
  p[1][VELOCITY] = p[VELOCITY][1] = together * tilt * velocity;
  p[0][VELOCITY + 1u] = p[VELOCITY + 1u][0] = -together * tilt * velocity;
}

// Replace P by F P; called twice with a transposition between, this is F P F^T.
static void propagate(float (*p)[GC_ERRORS], float dt, const float (*turn)[3], float gravity, bool with_bias) {
  const float fall = gravity * dt, bend = with_bias ? 0.5f * dt * fall : 0.0f, drift = with_bias ? dt : 0.0f;
  for (uint32_t c = 0; c < GC_ERRORS; ++c) {
    float turned[3];
    for (uint32_t i = 0; i < 3u; ++i) {
      turned[i] = (turn[i][0] * p[BIAS][c] + turn[i][1] * p[BIAS + 1u][c]) + turn[i][2] * p[BIAS + 2u][c];
    }
    p[VELOCITY][c] += fall * p[1][c] - bend * turned[1];
    p[VELOCITY + 1u][c] += bend * turned[0] - fall * p[0][c];
    for (uint32_t i = 0; i < 3u; ++i) {
      p[i][c] -= drift * turned[i];
    }
  }
}

static void transpose(float (*p)[GC_ERRORS]) {
  for (uint32_t i = 0; i < GC_ERRORS; ++i) {
    for (uint32_t k = 0; k < i; ++k) {
      const float swapped = p[i][k];
      p[i][k] = p[k][i];
      p[k][i] = swapped;
    }
  }
}

// Make the matrix symmetric, which rounding slowly undoes.
static void symmetrise(float (*p)[GC_ERRORS]) {
  for (uint32_t i = 0; i < GC_ERRORS; ++i) {
    for (uint32_t k = 0; k < i; ++k) {
      p[i][k] = p[k][i] = 0.5f * (p[i][k] + p[k][i]);
    }
  }
}

void gc_covariance_predict(gc_error_covariance *covariance, float dt, gc_quaternion middle, float gravity, gc_step_noise noise,
                           bool with_bias) {
  float(*p)[GC_ERRORS] = covariance->matrix;
  float turn[3][3];
  gc_quaternion_matrix(middle, turn);
  propagate(p, dt, (const float(*)[3])turn, gravity, with_bias);
  transpose(p);
  propagate(p, dt, (const float(*)[3])turn, gravity, with_bias);
  symmetrise(p);
  for (uint32_t i = 0; i < 3u; ++i) {
    p[i][i] += noise.tilt;
    p[BIAS + i][BIAS + i] += noise.bias;
    p[VELOCITY + i][VELOCITY + i] += noise.velocity;
  }
}

// Take the measurement that component h of the error state is z, with a variance.
static void take(float (*p)[GC_ERRORS], uint32_t h, float z, float variance, float *error) {
  const float inverse = 1.0f / (p[h][h] + variance), innovation = z - error[h];
  float row[GC_ERRORS];
  gc_copy(row, p[h], sizeof row);
  for (uint32_t i = 0; i < GC_ERRORS; ++i) {
    const float gain = row[i] * inverse;
    error[i] += gain * innovation;
    for (uint32_t k = 0; k <= i; ++k) {
      p[i][k] -= gain * row[k];
      p[k][i] = p[i][k];
    }
  }
}

// Remove the correlation of yaw and of the bias about the vertical with the other errors, which the velocity does not show.
static void forget_vertical(float (*p)[GC_ERRORS], gc_quaternion q) {
  float apart[2][GC_ERRORS], related[2][GC_ERRORS], between[2][2];
  gc_zero(apart, sizeof apart);
  apart[0][BIAS] = 2.0f * (q.x * q.z - q.w * q.y);
  apart[0][BIAS + 1u] = 2.0f * (q.y * q.z + q.w * q.x);
  apart[0][BIAS + 2u] = 1.0f - 2.0f * (q.x * q.x + q.y * q.y);
  apart[1][YAW] = 1.0f;
  for (uint32_t e = 0; e < 2u; ++e) {
    for (uint32_t k = 0; k < GC_ERRORS; ++k) {
      related[e][k] = e == 1u ? p[YAW][k]
                              : (apart[0][BIAS] * p[BIAS][k] + apart[0][BIAS + 1u] * p[BIAS + 1u][k]) +
                                    apart[0][BIAS + 2u] * p[BIAS + 2u][k];
    }
    for (uint32_t f = 0; f < 2u; ++f) {
      between[e][f] = 0.0f;
      for (uint32_t k = 0; k < GC_ERRORS; ++k) {
        between[e][f] += related[e][k] * apart[f][k];
      }
    }
  }
  for (uint32_t e = 0; e < 2u; ++e) {
    for (uint32_t k = 0; k < GC_ERRORS; ++k) {
      related[e][k] -= between[e][0] * apart[0][k] + between[e][1] * apart[1][k];
    }
  }
  for (uint32_t i = 0; i < GC_ERRORS; ++i) {
    for (uint32_t k = 0; k <= i; ++k) {
      const float removed = (apart[0][i] * related[0][k] + apart[1][i] * related[1][k]) +
                            (apart[0][k] * related[0][i] + apart[1][k] * related[1][i]);
      p[i][k] -= removed;
      p[k][i] = p[i][k];
    }
  }
}

void gc_covariance_correct_velocity(gc_error_covariance *covariance, const float *velocity, float variance,
                                    gc_quaternion orientation, float *error) {
  gc_zero(error, sizeof(float) * GC_ERRORS);
  forget_vertical(covariance->matrix, orientation);
  for (uint32_t i = 0; i < 3u; ++i) {
    take(covariance->matrix, VELOCITY + i, -velocity[i], variance, error);
  }
}

void gc_covariance_correct_at_rest(gc_error_covariance *covariance, const float *velocity, const float *bias_residual,
                                   float velocity_variance, float bias_variance, float *error) {
  gc_zero(error, sizeof(float) * GC_ERRORS);
  for (uint32_t i = 0; i < 3u; ++i) {
    take(covariance->matrix, VELOCITY + i, -velocity[i], velocity_variance, error);
  }
  for (uint32_t i = 0; i < 3u; ++i) {
    take(covariance->matrix, BIAS + i, bias_residual[i], bias_variance, error);
  }
}
