#include "orientation.h"

#include "../core/maths.h"
#include "../core/memory.h"
#include "trigonometry.h"

#define GC_START_TILT_STD 0.0872664626f   // rad
#define GC_START_YAW_STD 1.745329252e-3f  // rad
#define GC_START_VELOCITY_STD 0.5f        // m/s
#define GC_SATURATED_RATE_NOISE 2.0f      // rad/s/sqrt(Hz)
#define GC_STUCK_RATE_NOISE 0.3f
#define GC_UNKNOWN_ACCEL_NOISE 5.0f       // m/s^2/sqrt(Hz)
#define GC_CONTRADICTION 0.5f             // m/s
#define GC_CONTRADICTED_TILT 0.0349065850f  // rad
#define GC_GATE_SURE_GYRO 1.5f
#define GC_GATE_SURE_ACCEL 1.0f
#define GC_REVIEW_SURE_GYRO 2.0f
#define GC_REVIEW_SURE_ACCEL 1.0f
#define GC_PATIENCE_GYRO 2.0f
#define GC_MISSED_PERIODS 2.5f
#define GC_GRAVITY_TIME 1.0f  // s
#define GC_LARGEST_SCALE 0.1f

static float squared(float x) { return x * x; }

static float length_of(const float *v) { return gc_sqrt((v[0] * v[0] + v[1] * v[1]) + v[2] * v[2]); }

static float distance(const float *a, const float *b) {
  return gc_sqrt((squared(a[0] - b[0]) + squared(a[1] - b[1])) + squared(a[2] - b[2]));
}

static void forget_suspects(gc_orientation *filter) {
  gc_spike_gate_reset(&filter->gyro_gate);
  gc_spike_gate_reset(&filter->accel_gate);
  gc_spike_review_reset(&filter->gyro_review);
  gc_spike_review_reset(&filter->accel_review);
  filter->kept_count = 0;
}

void gc_orientation_reset(gc_orientation *filter, const gc_settings *settings) {
  gc_zero(filter, sizeof *filter);
  filter->settings = settings;
  filter->state.orientation.w = 1.0f;
  filter->state.gravity_norm = settings->gravity;
  filter->gyro_gate.floor = settings->spike_gyro;
  filter->gyro_gate.sure = GC_GATE_SURE_GYRO;
  filter->gyro_gate.patience = GC_PATIENCE_GYRO;
  filter->accel_gate.floor = settings->spike_accel;
  filter->accel_gate.sure = GC_GATE_SURE_ACCEL;
  filter->accel_gate.patience = 1.0f;
  filter->gyro_review.floor = settings->spike_gyro;
  filter->gyro_review.sure = GC_REVIEW_SURE_GYRO;
  filter->accel_review.floor = settings->spike_accel;
  filter->accel_review.sure = GC_REVIEW_SURE_ACCEL;
  gc_sample_check_reset(&filter->check);
  gc_covariance_set_bias(&filter->state.errors, settings->bias_initial);
  forget_suspects(filter);
}

// What follows is no continuation of the samples so far.
static void interrupt(gc_filter_state *state) {
  gc_swings_interrupt(&state->swings);
  gc_vibration_interrupt(state->vibration, GC_FORCE_MEANS);
}

// Start with the inclination from one specific force; yaw and bias continue where there was an orientation before.
static void start(gc_orientation *filter, const float *gyro, const float *accel, float gap) {
  gc_filter_state *state = &filter->state;
  float(*p)[GC_ERRORS] = state->errors.matrix;
  float yaw = 0.0f, yaw_variance = squared(GC_START_YAW_STD);
  if (filter->started) {
    yaw = gc_quaternion_yaw(state->orientation);
    yaw_variance = p[2][2] + squared(distance(state->last_gyro, state->bias) * gap);
  }
  const float norm = length_of(accel), excess = norm / state->gravity_norm - 1.0f;
  const float tilt_variance = squared(GC_START_TILT_STD) + squared(excess);
  if (norm > 0.0f) {
    state->orientation = gc_quaternion_level(accel, yaw);
  }
  for (uint32_t i = 0; i < GC_ERRORS; ++i) {
    for (uint32_t k = 0; k < GC_ERRORS; ++k) {
      const bool of_bias = i >= 3u && i < 6u && k >= 3u && k < 6u;
      p[i][k] = of_bias ? p[i][k] + (i == k ? squared(filter->settings->bias_walk) * gap : 0.0f) : 0.0f;
    }
  }
  p[0][0] = p[1][1] = tilt_variance;
  p[2][2] = yaw_variance;
  p[6][6] = p[7][7] = p[8][8] = squared(GC_START_VELOCITY_STD);
  gc_zero(state->velocity, sizeof state->velocity);
  filter->contradicted = false;
  state->rest.started = false;
  state->rest.still = state->rest.calm = 0u;
  state->alignment.active = false;
  interrupt(state);
  gc_copy(state->last_gyro, gyro, sizeof state->last_gyro);
  state->period = 0.0f;
  filter->started = true;
}

// Return whether samples are missing in a step of dt s.
static bool is_gap(const gc_filter_state *state, float dt) {
  return state->period > 0.0f && dt > GC_MISSED_PERIODS * state->period;
}

// Set the inclination to that of the alignment, with its uncertainty.
static void set_aligned(gc_filter_state *state) {
  float upward[3], up[3], velocity_std = GC_START_VELOCITY_STD, together = 0.0f;
  const float tilt_std = gc_alignment_inclination(&state->alignment, state->gravity_norm, upward);
  gc_quaternion_rotate(state->orientation, upward, up);
  const float across = gc_sqrt(up[0] * up[0] + up[1] * up[1]);
  if (across > 0.0f) {
    const float tilt = gc_atan2(across, up[2]) / across;
    state->orientation = gc_quaternion_normalised(
        gc_quaternion_product(gc_quaternion_exponential(tilt * up[1], -tilt * up[0], 0.0f), state->orientation));
  }
  gc_zero(state->velocity, sizeof state->velocity);
  if (!state->alignment.active) {
    velocity_std = gc_alignment_motion(&state->alignment, state->gravity_norm, state->velocity, &together);
    gc_quaternion_rotate(state->orientation, state->velocity, state->velocity);
  }
  gc_covariance_set_tilt_and_velocity(&state->errors, tilt_std, velocity_std, together);
}

// Begin the alignment with the inclination of the state, as sure as that is.
static void align_anew(gc_filter_state *state, const float *force) {
  const float vertical[3] = {0.0f, 0.0f, 1.0f};
  float(*p)[GC_ERRORS] = state->errors.matrix;
  gc_earlier earlier;
  gc_quaternion_rotate(gc_quaternion_conjugate(state->orientation), vertical, earlier.upward);
  earlier.variance = p[0][0];
  earlier.bias_variance = gc_max(0.0f, gc_max(p[3][3], gc_max(p[4][4], p[5][5])));
  gc_alignment_begin(&state->alignment, force, state->gravity_norm, &earlier);
}

// Return the variance on each axis of a turn by a measured rate (3,) in rad/s for dt s, rad^2.
static float turn_variance(const gc_settings *s, float dt, const float *rate) {
  const float rate_squared = (rate[0] * rate[0] + rate[1] * rate[1]) + rate[2] * rate[2];
  return (squared(s->gyro_noise) + squared(s->gyro_noise_per_rate) * rate_squared) * dt;
}

// Return the angle in rad between the mean specific force at rest and the vertical of the orientation.
static float contradicted_tilt(const gc_filter_state *state) {
  float up[3];
  gc_quaternion_rotate(state->orientation, state->rest.mean_accel, up);
  return gc_atan2(gc_sqrt(up[0] * up[0] + up[1] * up[1]), up[2]);
}

static void predict(gc_orientation *filter, const gc_filter_step *step) {
  const gc_settings *s = filter->settings;
  gc_filter_state *state = &filter->state;
  const float dt = step->dt;
  float unbiased[3], rate[3], extra_tilt = 0.0f, extra_velocity = 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    unbiased[i] = step->gyro_usable ? step->gyro[i] - state->bias[i] : 0.0f;
  }
  gc_copy(rate, unbiased, sizeof rate);
  if (is_gap(state, dt)) {
    extra_tilt = gc_swings_across(&state->swings, dt, state->period, unbiased, step->doubt, rate);
    extra_velocity = squared(GC_UNKNOWN_ACCEL_NOISE) * dt;
    interrupt(state);
  } else {
    state->period = state->period > 0.0f ? state->period + 0.05f * (dt - state->period) : dt;
  }
  if (step->gyro_usable) {
    gc_swings_watch(&state->swings, dt, unbiased);
  }
  if (step->accel_usable) {
    gc_vibration_take(state->vibration, GC_FORCE_MEANS, dt, step->accel);
  }
  gc_copy(state->last_gyro, step->gyro_usable ? step->gyro : state->bias, sizeof state->last_gyro);
  const float half = 0.5f * dt;
  const gc_quaternion before = state->orientation;
  const gc_quaternion middle =
      gc_quaternion_product(before, gc_quaternion_exponential(rate[0] * half, rate[1] * half, rate[2] * half));
  state->orientation = gc_quaternion_normalised(
      gc_quaternion_product(before, gc_quaternion_exponential(rate[0] * dt, rate[1] * dt, rate[2] * dt)));
  if (step->accel_usable) {
    float force[3];
    gc_quaternion_rotate(middle, step->accel, force);
    state->velocity[0] += force[0] * dt;
    state->velocity[1] += force[1] * dt;
    state->velocity[2] += (force[2] - state->gravity_norm) * dt;
  }
  float tilt = turn_variance(s, dt, rate) + extra_tilt;
  if (!step->gyro_usable) {
    tilt += squared(filter->contradicted ? GC_STUCK_RATE_NOISE : GC_SATURATED_RATE_NOISE) * dt;
  }
  const bool with_bias = s->bias_estimation > 0.0f;
  const float walk = filter->temperature_stable ? s->bias_walk_stable : s->bias_walk;
  // The velocity is a sum of samples: it has their noise where that is more than the data sheet says.
  const float force_noise = step->accel_usable
                                ? gc_max(squared(s->accel_noise), gc_vibration_density(state->vibration, GC_FORCE_MEANS))
                                : squared(GC_UNKNOWN_ACCEL_NOISE);
  const gc_step_noise noise = {
      tilt,
      with_bias ? squared(walk) * dt : 0.0f,
      force_noise * dt + extra_velocity,
  };
  gc_covariance_predict(&state->errors, dt, middle, state->gravity_norm, noise, with_bias);
}

static void correct(gc_orientation *filter, float dt, bool measure_bias) {
  const gc_settings *s = filter->settings;
  gc_filter_state *state = &filter->state;
  const float variance = squared(s->velocity_noise) / dt;
  float error[GC_ERRORS];
  if (measure_bias) {
    float residual[3];
    for (uint32_t i = 0; i < 3u; ++i) {
      residual[i] = state->rest.mean_gyro[i] - state->bias[i];
    }
    gc_covariance_correct_at_rest(&state->errors, state->velocity, residual, variance, squared(s->rest_noise) / dt, error);
  } else {
    gc_covariance_correct_velocity(&state->errors, state->velocity, variance, state->orientation, error);
  }
  state->orientation = gc_quaternion_normalised(
      gc_quaternion_product(gc_quaternion_exponential(error[0], error[1], error[2]), state->orientation));
  for (uint32_t i = 0; i < 3u; ++i) {
    state->bias[i] += error[3u + i];
    state->velocity[i] += error[6u + i];
  }
}

// Learn |a| at rest: if it were not g, the sensor would seem to accelerate along the vertical all the time.
static void learn_gravity(gc_filter_state *state, const gc_settings *s, float dt) {
  const float norm = length_of(state->rest.mean_accel);
  const float previous = state->norm_at_rest > 0.0f ? state->norm_at_rest : norm;
  state->norm_at_rest = previous + dt / (GC_GRAVITY_TIME + dt) * (norm - previous);
  state->gravity_norm =
      gc_clamp(state->norm_at_rest, (1.0f - GC_LARGEST_SCALE) * s->gravity, (1.0f + GC_LARGEST_SCALE) * s->gravity);
}

// Take a sample into the state. Returns false where gravity at rest contradicts the orientation, which then starts again.
static bool advance(gc_orientation *filter, const gc_filter_step *step) {
  const gc_settings *s = filter->settings;
  gc_filter_state *state = &filter->state;
  bool resting = false;
  if (step->gyro_usable && step->accel_usable) {
    float deviation[3];
    for (uint32_t i = 0; i < 3u; ++i) {
      deviation[i] = gc_sqrt(gc_max(0.0f, state->errors.matrix[3u + i][3u + i]));
    }
    resting = gc_rest_take(&state->rest, s, step->dt, step->gyro, step->accel, state->bias, deviation);
    // Calm and not resting: where the inclination is wrong, the bias is wrong, too.
    if (gc_rest_calm(&state->rest, s) && contradicted_tilt(state) > GC_CONTRADICTED_TILT) {
      float mean[3];
      gc_copy(mean, state->rest.mean_accel, sizeof mean);
      gc_covariance_set_bias(&state->errors, s->bias_initial);
      start(filter, step->gyro, mean, step->dt);
      return false;
    }
  } else {
    state->rest.started = false;
    state->rest.still = state->rest.calm = 0u;
  }
  const float variance = state->errors.matrix[0][0];
  const bool gap = is_gap(state, step->dt) && step->accel_usable;
  predict(filter, step);
  if (step->gyro_usable && step->accel_usable) {
    gc_alignment_watch(&state->alignment, step->dt, step->accel, s->gravity);
  }
  const bool broken = state->alignment.active && step->dt > GC_SWING;
  if (gap && (broken || state->errors.matrix[0][0] > 2.0f * variance)) {  // it is mostly that of the gap
    align_anew(state, step->accel);
    set_aligned(state);
    return true;
  }
  if (state->alignment.active && step->gyro_usable) {
    const float noise = step->accel_usable ? gc_sqrt(gc_vibration_density(state->vibration, GC_FORCE_MEANS))
                                           : GC_UNKNOWN_ACCEL_NOISE;
    float turn[3];
    for (uint32_t i = 0; i < 3u; ++i) {
      turn[i] = step->gyro[i] - state->bias[i];
    }
    gc_alignment_take(&state->alignment, step->dt, turn, step->accel, state->gravity_norm, noise,
                      turn_variance(s, step->dt, turn));
    set_aligned(state);
    return true;
  }
  if (state->alignment.active) {
    align_anew(state, step->accel);
  }
  if (step->accel_usable) {
    correct(filter, step->dt, resting && s->bias_estimation > 0.0f);
  }
  if (resting) {
    learn_gravity(state, s, step->dt);
  }
  return true;
}

// Return the step `age` samples ago.
static gc_kept_step *kept_step(gc_orientation *filter, uint32_t age) {
  return &filter->kept[(filter->kept_next + GC_STEPS_MAX - age) % GC_STEPS_MAX];
}

static void keep(gc_orientation *filter, const gc_filter_step *step) {
  gc_kept_step *kept = &filter->kept[filter->kept_next];
  kept->before = filter->state;
  kept->step = *step;
  filter->kept_next = (filter->kept_next + 1u) % GC_STEPS_MAX;
  filter->kept_count += filter->kept_count < GC_STEPS_MAX ? 1u : 0u;
}

// Let a sensor's value (3,) count in the step `age` samples ago. Returns how many steps have to be repeated.
static uint32_t count_in(gc_orientation *filter, uint32_t age, bool accelerometer, const float *value) {
  if (age > filter->kept_count) {
    return 0;
  }
  gc_filter_step *step = &kept_step(filter, age)->step;
  float *used = accelerometer ? step->accel : step->gyro;
  bool changed = false;
  for (uint32_t i = 0; i < 3u; ++i) {
    changed = changed || used[i] < value[i] || used[i] > value[i];
    used[i] = value[i];
  }
  if (changed && !accelerometer) {
    step->doubt = 0.0f;
  }
  return changed ? age : 0u;
}

static uint32_t larger(uint32_t a, uint32_t b) { return a > b ? a : b; }

// Take a sensor's value through its gate and its review, and let what they decide count in the last steps. Returns how many of them
// have to be repeated.
static uint32_t decide(gc_orientation *filter, gc_filter_step *step, bool accelerometer) {
  gc_spike_gate *gate = accelerometer ? &filter->accel_gate : &filter->gyro_gate;
  gc_spike_review *review = accelerometer ? &filter->accel_review : &filter->gyro_review;
  if (!(accelerometer ? step->accel_usable : step->gyro_usable)) {
    gc_spike_gate_reset(gate);
    gc_spike_review_reset(review);
    return 0;
  }
  float *value = accelerometer ? step->accel : step->gyro;
  float measured[3], counted[GC_SUSPECTS_MAX][3];
  uint32_t changed = 0;
  gc_copy(measured, value, sizeof measured);
  if (is_gap(&filter->state, step->dt)) {
    gc_spike_review_reset(review);
    if (step->dt > filter->settings->spike_time_constant) {
      gc_spike_gate_reset(gate);  // what the signal was like is forgotten
    }
  }
  if (gc_spike_review_take(review, filter->settings, step->dt, measured, counted[0])) {
    changed = count_in(filter, GC_REVIEW_AHEAD, accelerometer, counted[0]);
  }
  const uint32_t count = gc_spike_gate_take(gate, filter->settings, step->dt, value, counted);
  for (uint32_t age = 1; age <= count && age < GC_REVIEW_AHEAD; ++age) {  // the review decides older ones
    changed = larger(changed, count_in(filter, age, accelerometer, counted[count - age]));
  }
  if (!accelerometer) {
    step->doubt = distance(measured, value);
  }
  return changed;
}

// Remove spikes from a sample, and repeat the steps since the first one for which another value counts.
static void without_spikes(gc_orientation *filter, gc_filter_step *step) {
  const uint32_t of_rates = decide(filter, step, false), of_forces = decide(filter, step, true);
  const uint32_t changed = larger(of_rates, of_forces);
  if (changed > 0u) {
    filter->state = kept_step(filter, changed)->before;
  }
  for (uint32_t age = changed; age > 0u; --age) {
    gc_kept_step *kept = kept_step(filter, age);
    kept->before = filter->state;
    (void)advance(filter, &kept->step);
  }
}

static void estimate_of(const gc_orientation *filter, const float *gyro, gc_orientation_estimate *estimate) {
  const gc_filter_state *state = &filter->state;
  const float delay = filter->settings->delay;
  for (uint32_t i = 0; i < 3u; ++i) {
    estimate->rate[i] = gyro[i] - state->bias[i];
  }
  estimate->orientation = gc_quaternion_normalised(
      gc_quaternion_product(state->orientation, gc_quaternion_exponential(estimate->rate[0] * delay, estimate->rate[1] * delay,
                                                                          estimate->rate[2] * delay)));
}

// Set which sensors of a sample can be used: repeated values can, unless they contradict each other.
static void set_usable(gc_orientation *filter, const gc_verdict *verdict, gc_filter_step *step) {
  const bool stuck = verdict->gyro_stuck || verdict->accel_stuck;
  filter->contradicted = stuck && (filter->contradicted || length_of(filter->state.velocity) > GC_CONTRADICTION);
  step->gyro_usable = !verdict->gyro_saturated && !(verdict->gyro_stuck && filter->contradicted);
  step->accel_usable = !verdict->accel_saturated && !(verdict->accel_stuck && filter->contradicted);
}

bool gc_orientation_take(gc_orientation *filter, int64_t stamp, const float *gyro, const float *accel,
                         gc_orientation_estimate *estimate) {
  const gc_verdict verdict = gc_sample_check_take(&filter->check, filter->settings, stamp, gyro, accel);
  if (gc_problem_rejects(verdict.problem)) {
    return false;
  }
  if (!filter->started || verdict.problem == GC_PROBLEM_CLOCK_RESTARTED || verdict.problem == GC_PROBLEM_GAP) {
    start(filter, gyro, accel, verdict.dt);
    gc_alignment_begin(&filter->state.alignment, accel, filter->state.gravity_norm, 0);
    set_aligned(&filter->state);
    gc_zero(&filter->even, sizeof filter->even);
    forget_suspects(filter);
    estimate_of(filter, gyro, estimate);
    return true;
  }
  gc_filter_step step;
  step.doubt = 0.0f;
  step.dt = gc_even_steps_take(&filter->even, verdict.dt);
  gc_copy(step.gyro, gyro, sizeof step.gyro);
  gc_copy(step.accel, accel, sizeof step.accel);
  set_usable(filter, &verdict, &step);
  without_spikes(filter, &step);
  keep(filter, &step);
  if (!advance(filter, &step)) {
    forget_suspects(filter);
    estimate_of(filter, step.gyro, estimate);
    return true;
  }
  estimate_of(filter, step.gyro_usable ? step.gyro : filter->state.bias, estimate);
  return true;
}
