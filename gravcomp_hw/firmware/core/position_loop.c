#include "position_loop.h"

#include "maths.h"

#define REST_COUNTS 37.5f  // of the rotor; within them the integral is frozen, because gears stick

void gc_position_loop_reset(gc_position_loop *loop, float displacement, float holding) {
  loop->setpoint = displacement;
  loop->setpoint_velocity = 0.0f;
  loop->integral = holding;
}

float gc_position_loop_rest_error(const gc_parameters *parameters) {
  return REST_COUNTS * gc_parameter_real(parameters, GC_TRAVEL_PER_COUNT);
}

static void advance(gc_position_loop *loop, float target, float acceleration, float fastest, float dt) {
  const float remaining = target - loop->setpoint;
  const float change = acceleration * dt;
  // Largest v from which the setpoint can still stop on the target: v dt + v^2 / (2 a) <= |remaining|.
  const float reachable = gc_sqrt(change * change + 2.0f * acceleration * gc_abs(remaining)) - change;
  const float speed = gc_min(fastest, reachable);
  const float wanted = remaining < 0.0f ? -speed : speed;
  loop->setpoint_velocity += gc_clamp(wanted - loop->setpoint_velocity, -change, change);
  if (gc_abs(remaining) <= 0.5f * change * dt && gc_abs(loop->setpoint_velocity) <= change) {
    loop->setpoint = target;
    loop->setpoint_velocity = 0.0f;
  } else {
    loop->setpoint += loop->setpoint_velocity * dt;
  }
}

float gc_position_loop_step(gc_position_loop *loop, const gc_parameters *parameters, const gc_position_input *input) {
  const float most = 1e-3f * (float)gc_parameter_int(parameters, GC_CURRENT_LIMIT);
  const float fastest = input->fastest;
  if (input->dt > 0.0f) {
    advance(loop, input->target, gc_parameter_real(parameters, GC_ACCELERATION_LIMIT), fastest, input->dt);
  }
  const float error = loop->setpoint - input->displacement;
  const float gain = gc_parameter_real(parameters, GC_POSITION_GAIN);
  const float wanted = gc_clamp(loop->setpoint_velocity + gain * error, -fastest, fastest);
  const float lag = wanted - input->velocity;
  const float proportional = gc_parameter_real(parameters, GC_VELOCITY_GAIN) * lag +
                             input->pull / gc_parameter_real(parameters, GC_NEWTON_PER_AMPERE);
  const bool at_rest = gc_abs(error) < gc_position_loop_rest_error(parameters) && gc_abs(loop->setpoint_velocity) <= 0.0f;
  float integral = loop->integral;
  if (!at_rest) {
    integral += gc_parameter_real(parameters, GC_VELOCITY_INTEGRAL) * lag * input->dt;
  }
  if (gc_abs(proportional + integral) < most || gc_abs(integral) < gc_abs(loop->integral)) {
    loop->integral = gc_clamp(integral, -most, most);
  }
  return gc_clamp(proportional + loop->integral, -most, most);
}
