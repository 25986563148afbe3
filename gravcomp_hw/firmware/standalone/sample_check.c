#include "sample_check.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_SATURATED_FROM 0.995f  // of full scale
#define GC_RESTART_AFTER 10u      // older samples in a row: the clock was set back

void gc_sample_check_reset(gc_sample_check *check) {
  gc_zero(check, sizeof *check);
  for (uint32_t i = 0; i < 3u; ++i) {
    check->gyro[i] = check->accel[i] = __builtin_nanf("");
  }
}

static float largest_of(const float *vector) {
  return gc_max(gc_abs(vector[0]), gc_max(gc_abs(vector[1]), gc_abs(vector[2])));
}

static bool finite(const float *vector) { return gc_finite(vector[0]) && gc_finite(vector[1]) && gc_finite(vector[2]); }

static bool equal(const float *a, const float *b) {
  bool same = true;
  for (uint32_t i = 0; i < 3u; ++i) {
    same = same && a[i] >= b[i] && a[i] <= b[i];  // false for NaN
  }
  return same;
}

static gc_problem backward(gc_sample_check *check, int64_t stamp) {
  if (stamp == check->stamp) {
    return GC_PROBLEM_REPEATED_STAMP;
  }
  // After the clock was set back the stamps advance; those of single late samples do not.
  check->older = check->older > 0u && stamp > check->older_stamp ? check->older + 1u : 1u;
  check->older_stamp = stamp;
  return check->older >= GC_RESTART_AFTER ? GC_PROBLEM_CLOCK_RESTARTED : GC_PROBLEM_REORDERED_STAMP;
}

bool gc_problem_rejects(gc_problem problem) {
  return problem == GC_PROBLEM_NOT_FINITE || problem == GC_PROBLEM_OUT_OF_RANGE || problem == GC_PROBLEM_REPEATED_STAMP ||
         problem == GC_PROBLEM_REORDERED_STAMP;
}

gc_verdict gc_sample_check_take(gc_sample_check *check, const gc_settings *settings, int64_t stamp, const float *gyro,
                                const float *accel) {
  gc_verdict verdict = {GC_PROBLEM_NONE, 0.0f, false, false, false, false};
  if (!finite(gyro) || !finite(accel)) {
    verdict.problem = GC_PROBLEM_NOT_FINITE;
    return verdict;
  }
  const float fastest = largest_of(gyro), strongest = largest_of(accel);
  if (fastest > 1.01f * settings->gyro_range || strongest > 1.01f * settings->accel_range) {
    verdict.problem = GC_PROBLEM_OUT_OF_RANGE;
    return verdict;
  }
  if (check->started) {
    int64_t step = stamp - check->stamp;
    if (step <= 0) {
      verdict.problem = backward(check, stamp);
      if (verdict.problem != GC_PROBLEM_CLOCK_RESTARTED) {
        return verdict;
      }
      step = 0;
    }
    verdict.dt = (float)(step < 1000000000 ? (int32_t)step : 1000000000) * 1e-6f;
    if (verdict.dt > settings->largest_gap) {
      verdict.problem = GC_PROBLEM_GAP;
    }
  }
  check->started = true;
  check->older = 0;
  check->stamp = stamp;
  check->gyro_same = equal(gyro, check->gyro) ? check->gyro_same + verdict.dt : 0.0f;
  check->accel_same = equal(accel, check->accel) ? check->accel_same + verdict.dt : 0.0f;
  gc_copy(check->gyro, gyro, sizeof check->gyro);
  gc_copy(check->accel, accel, sizeof check->accel);
  verdict.gyro_stuck = check->gyro_same >= settings->stuck_time;
  verdict.accel_stuck = check->accel_same >= settings->stuck_time;
  verdict.gyro_saturated = fastest >= GC_SATURATED_FROM * settings->gyro_range;
  verdict.accel_saturated = strongest >= GC_SATURATED_FROM * settings->accel_range;
  return verdict;
}
