#include "alignment.h"

#include "../core/maths.h"
#include "../core/memory.h"
#include "quaternion.h"

#define GC_LONGEST 10.0f              // s
#define GC_SURE 0.0174532925f         // rad
#define GC_START_STD 0.0872664626f    // rad
#define GC_LARGEST_STD 1.57079633f    // rad
#define GC_LEAST_SURE 0.261799388f    // rad: an earlier inclination that tells nothing
#define GC_TRUSTED 2.0f               // s: the line is surer than its standard deviation says, more with each second
#define GC_MEMORY 1.0f                // s
#define GC_SMOOTHING 0.05f            // s
#define GC_SLOWEST 0.4f               // of the time since the start: the longest time scale that a line leaves
#define GC_HIDDEN 1.5f                // RMS of the acceleration in the line, of that left by it, where the motion is as slow
#define GC_PI 3.14159265f
#define GC_ROOT_OF_THREE 1.73205081f

static float std_of(const gc_alignment *alignment, float gravity);

static float squared(float x) { return x * x; }

static float square_of(const float *v) { return (v[0] * v[0] + v[1] * v[1]) + v[2] * v[2]; }

void gc_alignment_watch(gc_alignment *alignment, float dt, const float *force, float gravity) {
  const float shaken = squared(gc_sqrt(square_of(force)) / gravity - 1.0f);
  alignment->shaken += dt / (GC_MEMORY + dt) * (shaken - alignment->shaken);
}

// Write the vector (3,) with length 1; zero stays.
static void set_unit(float *unit, const float *vector) {
  const float length = gc_sqrt(square_of(vector)), scale = length > 0.0f ? 1.0f / length : 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    unit[i] = scale * vector[i];
  }
}

void gc_alignment_begin(gc_alignment *alignment, const float *force, float gravity, const gc_earlier *earlier) {
  alignment->shaken = gc_max(alignment->shaken, squared(gc_sqrt(square_of(force)) / gravity - 1.0f));
  alignment->active = true;
  alignment->elapsed = alignment->square = 0.0f;
  alignment->force_square = alignment->unsure = 0.0f;
  gc_copy(alignment->force, force, sizeof alignment->force);
  gc_zero(alignment->velocity, sizeof alignment->velocity);
  gc_zero(alignment->sum, sizeof alignment->sum);
  gc_zero(alignment->moment, sizeof alignment->moment);
  set_unit(alignment->line, force);
  alignment->has_earlier = earlier != 0;
  if (earlier != 0) {
    alignment->earlier = *earlier;
  }
}

// Write the slope (3,) of the line that fits the velocity best, m/s^2.
static void slope_of(const gc_alignment *alignment, float *slope) {
  const float t = alignment->elapsed;
  for (uint32_t i = 0; i < 3u; ++i) {
    slope[i] = 12.0f * (alignment->moment[i] - 0.5f * t * alignment->sum[i]) / (t * t * t);
  }
}

// Return the mean square of the velocity's distance from the line, (m/s)^2.
static float scatter_of(const gc_alignment *alignment) {
  const float t = alignment->elapsed;
  float slope[3];
  slope_of(alignment, slope);
  const float on_line = square_of(alignment->sum) / (t * t) + square_of(slope) * t * t / 12.0f;
  return gc_max(0.0f, alignment->square / t - on_line);
}

// Return the RMS on each axis of the acceleration that is too slow to be left by the line, m/s^2.
static float hidden(const gc_alignment *alignment, float scatter) {
  const float t = alignment->elapsed;
  const float left = alignment->force_square / t - square_of(alignment->velocity) / (t * t);
  if (!(left > 0.0f)) {
    return 0.0f;
  }
  const float slow = gc_min(GC_PI * gc_sqrt(scatter / left) / (GC_SLOWEST * t), 1.0f);
  return GC_HIDDEN * slow * slow * gc_sqrt(left) / GC_ROOT_OF_THREE;
}

void gc_alignment_take(gc_alignment *alignment, float dt, const float *rate, const float *force, float gravity, float noise,
                       float turned) {
  const gc_quaternion turn = gc_quaternion_exponential(-rate[0] * dt, -rate[1] * dt, -rate[2] * dt);
  const float middle = alignment->elapsed + 0.5f * dt;
  float mean[3], slope[3], line[3];
  gc_quaternion_rotate(turn, alignment->velocity, alignment->velocity);
  gc_quaternion_rotate(turn, alignment->sum, alignment->sum);
  gc_quaternion_rotate(turn, alignment->moment, alignment->moment);
  for (uint32_t i = 0; i < 3u; ++i) {
    mean[i] = alignment->velocity[i] + 0.5f * force[i] * dt;
    alignment->velocity[i] += force[i] * dt;
    alignment->sum[i] += mean[i] * dt;
    alignment->moment[i] += middle * mean[i] * dt;
  }
  alignment->square += dt * square_of(mean);
  gc_quaternion_rotate(turn, alignment->force, alignment->force);
  const float gain = dt / (GC_SMOOTHING + dt);
  for (uint32_t i = 0; i < 3u; ++i) {
    alignment->force[i] += gain * (force[i] - alignment->force[i]);
  }
  alignment->force_square += dt * square_of(alignment->force);
  alignment->unsure += squared(noise) * dt;
  if (alignment->has_earlier) {
    gc_earlier *earlier = &alignment->earlier;
    gc_quaternion_rotate(turn, earlier->upward, earlier->upward);
    earlier->variance += turned + earlier->bias_variance * dt * (2.0f * alignment->elapsed + dt);
  }
  alignment->elapsed += dt;
  alignment->active = alignment->elapsed < GC_LONGEST && std_of(alignment, gravity) > GC_SURE;
  // Within a swing of the motion the mean is surer than the slope.
  const float share = gc_clamp(0.5f * (alignment->elapsed / GC_SWING - 1.0f), 0.0f, 1.0f);
  slope_of(alignment, slope);
  for (uint32_t i = 0; i < 3u; ++i) {
    line[i] = share * slope[i] + (1.0f - share) * alignment->velocity[i] / alignment->elapsed;
  }
  set_unit(alignment->line, line);
}

// Return the share of the earlier inclination, with the line's standard deviation in rad; write the variance of both in rad^2.
static float share_of(const gc_alignment *alignment, float std, float *variance) {
  const float earlier = alignment->earlier.variance;
  *variance = std * std;
  if (!alignment->has_earlier || !(earlier < squared(GC_LEAST_SURE))) {
    return 0.0f;
  }
  const float sure = 1.0f / earlier - 1.0f / squared(GC_LEAST_SURE);
  const float share = sure / (sure + squared((1.0f + squared(alignment->elapsed / GC_TRUSTED)) / std));
  *variance = squared(share) * earlier + squared((1.0f - share) * std);
  return share;
}

float gc_alignment_inclination(const gc_alignment *alignment, float gravity, float *up) {
  float variance;
  const float share = share_of(alignment, std_of(alignment, gravity), &variance);
  for (uint32_t i = 0; i < 3u; ++i) {
    up[i] = share * alignment->earlier.upward[i] + (1.0f - share) * alignment->line[i];
  }
  return gc_sqrt(variance);
}

float gc_alignment_motion(const gc_alignment *alignment, float gravity, float *velocity, float *together) {
  const float t = alignment->elapsed, std = std_of(alignment, gravity);
  float slope[3], variance;
  const float share = share_of(alignment, std, &variance);
  slope_of(alignment, slope);
  for (uint32_t i = 0; i < 3u; ++i) {
    const float along = slope[i] + share * (gravity * alignment->earlier.upward[i] - slope[i]);
    velocity[i] = alignment->velocity[i] - alignment->sum[i] / t - 0.5f * t * along;
  }
  // The error is that of the mean, and that of the slope since the middle of the time t.
  const float in_all = gc_sqrt(std * std / 12.0f + 0.25f * variance);
  *together = 0.5f * gc_sqrt(variance) / in_all;
  return in_all * gravity * t;
}

// Return the standard deviation of the line's inclination about each horizontal axis, rad.
static float std_of(const gc_alignment *alignment, float gravity) {
  const float t = alignment->elapsed, at_rest = gc_sqrt(squared(GC_START_STD) + alignment->shaken);
  if (!(t > 0.0f)) {
    return gc_min(at_rest, GC_LARGEST_STD);
  }
  const float scatter = scatter_of(alignment);
  const float before = alignment->shaken * squared(GC_SWING * gravity) * GC_SWING / (GC_SWING + t);
  const float resolved = 12.0f * (scatter + before) / (1.0f + t / GC_SWING);
  // A step of v by d turns the slope by 1.5 d / t at most.
  const float variance = resolved + 2.25f * alignment->unsure + squared(t * hidden(alignment, scatter));
  const float least = t > GC_SWING ? GC_START_STD * GC_SWING / t : at_rest;
  return gc_min(gc_max(gc_sqrt(variance) / (gravity * t), least), GC_LARGEST_STD);
}
