#include "motor.h"

#include "maths.h"

#define COUNTS_PER_S_AND_RPM 136.5333333f  // 8192 / 60
#define STANDSTILL 0.0125f                 // of the velocity limit
#define RUNAWAY_TIME 0.04f                 // s; a gear that breaks away is astray for some milliseconds

int32_t gc_motor_direction(const gc_parameters *parameters, uint32_t index) {
  const uint32_t reversed = (uint32_t)gc_parameter_int(parameters, GC_REVERSED);
  return (reversed >> index & 1u) != 0u ? -1 : 1;
}

int32_t gc_motor_counts(const gc_motor *motor, const gc_parameters *parameters, uint32_t index) {
  const int32_t from = motor->zero_known ? motor->zero : 0;
  return gc_motor_direction(parameters, index) * (motor->rotor.count - from);
}

float gc_motor_displacement(const gc_motor *motor, const gc_parameters *parameters, uint32_t index) {
  return (float)gc_motor_counts(motor, parameters, index) * gc_parameter_real(parameters, GC_TRAVEL_PER_COUNT);
}

float gc_motor_velocity(const gc_motor *motor, const gc_parameters *parameters, uint32_t index) {
  const float speed = (float)(gc_motor_direction(parameters, index) * motor->rotor.speed);
  return speed * COUNTS_PER_S_AND_RPM * gc_parameter_real(parameters, GC_TRAVEL_PER_COUNT);
}

int16_t gc_motor_clamp(gc_motor *motor, const gc_parameters *parameters, uint32_t index) {
  const int32_t continuous = gc_parameter_int(parameters, GC_CURRENT_CONTINUOUS);
  int32_t most = gc_parameter_int(parameters, GC_CURRENT_LIMIT);
  const float warm = 1e-3f * (float)continuous;
  if (motor->heat > warm * warm && continuous < most) {
    most = continuous;
  }
  int32_t current = gc_clamp_int(motor->wanted, -most, most);
  motor->at_stroke = false;
  if (motor->zero_known && motor->rotor.seen) {
    const float at = gc_motor_displacement(motor, parameters, index);
    const int32_t pull = gc_motor_direction(parameters, index) * current;
    const bool in = at >= gc_parameter_real(parameters, GC_DISPLACEMENT_MAX) && pull > 0;
    const bool out = at <= gc_parameter_real(parameters, GC_DISPLACEMENT_MIN) && pull < 0;
    if (in || out) {
      current = 0;
      motor->at_stroke = true;
    }
  }
  motor->clamped = current != motor->wanted;
  motor->current = (int16_t)current;
  return motor->current;
}

void gc_motor_warm(gc_motor *motor, const gc_parameters *parameters, float dt) {
  const float current = 1e-3f * (float)motor->current;
  const float lag = 1e-3f * (float)gc_parameter_int(parameters, GC_HEATING_TIME);
  motor->heat += (current * current - motor->heat) * dt / lag;
}

// Whether the motor pulls an antagonist when it turns back.
static bool is_two_way(const gc_parameters *parameters, uint32_t index) {
  return ((uint32_t)gc_parameter_int(parameters, GC_TWO_WAY) >> index & 1u) != 0u;
}

// Smallest feed-forward (N): an antagonist is pulled by the other sign.
static float least_pull(const gc_parameters *parameters, uint32_t index) {
  return is_two_way(parameters, index) ? -gc_parameter_real(parameters, GC_TENSION_LIMIT)
                                       : gc_parameter_real(parameters, GC_PRETENSION);
}

static float pull(const gc_motor *motor, const gc_parameters *parameters, uint32_t index) {
  return gc_clamp(motor->tension, least_pull(parameters, index), gc_parameter_real(parameters, GC_TENSION_LIMIT));
}

void gc_motor_hold(gc_motor *motor, const gc_parameters *parameters, uint32_t index) {
  const float current = 1e-3f * (float)(gc_motor_direction(parameters, index) * motor->current);
  motor->target = gc_motor_displacement(motor, parameters, index);
  motor->tension = 0.0f;
  const float forward = pull(motor, parameters, index) / gc_parameter_real(parameters, GC_NEWTON_PER_AMPERE);
  gc_position_loop_reset(&motor->loop, motor->target, current - forward);
  gc_take_up_reset(&motor->take_up);
  motor->astray = 0.0f;
  motor->stalled = 0.0f;
}

static void go(gc_motor *motor, const gc_parameters *parameters, uint32_t index, float dt, gc_way way) {
  const gc_position_input input = {
      .target = way.target,
      .pull = pull(motor, parameters, index),
      .displacement = gc_motor_displacement(motor, parameters, index),
      .velocity = gc_motor_velocity(motor, parameters, index),
      .fastest = way.fastest,
      .dt = dt,
  };
  const float current = gc_position_loop_step(&motor->loop, parameters, &input);
  motor->wanted = gc_motor_direction(parameters, index) * gc_round(1e3f * current);
}

void gc_motor_drive(gc_motor *motor, const gc_parameters *parameters, uint32_t index, float dt, float fastest) {
  const gc_way straight = {.target = motor->target, .fastest = fastest};
  go(motor, parameters, index, dt, straight);
}

void gc_motor_follow(gc_motor *motor, const gc_parameters *parameters, uint32_t index, float dt) {
  if (is_two_way(parameters, index)) {  // it has its cables on both flanks of the gear
    gc_motor_drive(motor, parameters, index, dt, gc_parameter_real(parameters, GC_VELOCITY_LIMIT));
    return;
  }
  const float at = gc_motor_displacement(motor, parameters, index);
  go(motor, parameters, index, dt, gc_take_up_step(&motor->take_up, parameters, motor->target, at, dt));
}

static bool only_pulls(const gc_parameters *parameters, uint32_t present, uint32_t index) {
  return (present >> index & 1u) != 0u && !is_two_way(parameters, index);
}

void gc_motors_act_together(gc_motor *motors, const gc_parameters *parameters, uint32_t present) {
  bool still = true;
  bool due = false;
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    if (only_pulls(parameters, present, index)) {
      still = still && gc_take_up_stays(&motors[index].take_up, parameters);
      due = due || gc_take_up_is_due(&motors[index].take_up, parameters);
    }
  }
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    motors[index].take_up.waits = !(still && due);
    motors[index].take_up.joins = still && due;
  }
}

bool gc_motor_is_astray(gc_motor *motor, const gc_parameters *parameters, uint32_t index, float dt) {
  const float velocity = gc_abs(gc_motor_velocity(motor, parameters, index));
  const float lag = gc_abs(motor->loop.setpoint - gc_motor_displacement(motor, parameters, index));
  const float fastest = gc_parameter_real(parameters, GC_VELOCITY_LIMIT);
  const bool far = lag > gc_parameter_real(parameters, GC_FOLLOWING_ERROR);
  const bool fast = velocity > gc_parameter_real(parameters, GC_OVERSPEED) * fastest;
  const int32_t limit = gc_parameter_int(parameters, GC_CURRENT_LIMIT);
  const bool full = 20 * gc_clamp_int(motor->current, -10000, 10000) >= 19 * limit || 20 * motor->current <= -19 * limit;
  motor->astray = far || fast ? motor->astray + dt : 0.0f;
  motor->stalled = full && velocity < STANDSTILL * fastest ? motor->stalled + dt : 0.0f;
  const float patience = 1e-3f * (float)gc_parameter_int(parameters, GC_STALL_TIME);
  return motor->astray >= RUNAWAY_TIME || motor->stalled >= patience;
}
