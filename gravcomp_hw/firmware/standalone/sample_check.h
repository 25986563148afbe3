// Checks of a sample before the filter takes it (src/gravcomp/orientation/guard.py).
#ifndef GC_SAMPLE_CHECK_H
#define GC_SAMPLE_CHECK_H

#include <stdbool.h>
#include <stdint.h>

#include "settings.h"

// What is wrong with a sample as a whole; that of one sensor is in the verdict.
typedef enum {
  GC_PROBLEM_NONE = 0,
  GC_PROBLEM_NOT_FINITE,
  GC_PROBLEM_OUT_OF_RANGE,
  GC_PROBLEM_REPEATED_STAMP,
  GC_PROBLEM_REORDERED_STAMP,
  GC_PROBLEM_CLOCK_RESTARTED,
  GC_PROBLEM_GAP
} gc_problem;

typedef struct {
  gc_problem problem;
  float dt;  // s since the last sample taken, 0 for the first
  bool gyro_saturated, accel_saturated, gyro_stuck, accel_stuck;
} gc_verdict;

typedef struct {
  bool started;
  int64_t stamp;  // us
  uint32_t older;
  int64_t older_stamp;  // us
  float gyro[3], accel[3];
  float gyro_same, accel_same;  // s for which the values have not changed
} gc_sample_check;

// Forget the stream: the next sample is the first.
void gc_sample_check_reset(gc_sample_check *check);

// Check the sample with the stamp in us; gyro (3,) in rad/s, accel (3,) in m/s^2.
gc_verdict gc_sample_check_take(gc_sample_check *check, const gc_settings *settings, int64_t stamp, const float *gyro,
                                const float *accel);

// Whether a sample with this problem must not be used.
bool gc_problem_rejects(gc_problem problem);

#endif
