#include "standalone.h"

#include "../core/maths.h"
#include "../core/memory.h"
#include "../core/heater.h"

#define GC_STANDARD_GRAVITY 9.80665f
#define GC_COUNTS 32767.0f
#define GC_DEGREE 0.0174532925f
#define GC_PAUSE 1.0f  // s between two samples after which the loop starts again

static const float COUNTS_PER_G[4] = {10920.0f, 5460.0f, 2730.0f, 1365.0f};              // of the ranges 3, 6, 12, 24 g
static const float FULL_RATE[5] = {2000.0f, 1000.0f, 500.0f, 250.0f, 125.0f};            // deg/s

void gc_standalone_moved(gc_standalone *loop, const gc_model *model) {
  loop->model = *model;
  loop->gravity.settings = loop->model.settings;
  loop->gravity.filter.settings = loop->model.settings;
  loop->equilibrium.model = &loop->model;
  loop->controller.model = &loop->model;
}

bool gc_standalone_take(gc_standalone *loop, const uint8_t *blob, size_t size, uint32_t magic, gc_alive *alive) {
  gc_model model;
  loop->refusal = gc_model_open(&model, blob, size, magic, loop->loaded ? loop->model.robot : NULL, alive);
  if (loop->refusal != GC_MODEL_OK) {
    return false;
  }
  gc_standalone_use(loop, &model);
  return true;
}

void gc_standalone_use(gc_standalone *loop, const gc_model *model) {
  gc_zero(loop, sizeof *loop);
  loop->model = *model;
  loop->loaded = true;
  gc_gravity_reset(&loop->gravity, model->settings);
  gc_equilibrium_reset(&loop->equilibrium, &loop->model);
  gc_inverse_reset(&loop->controller, &loop->model);  // homing leaves the cables where the straight robot has them
}

// Convert a sample's counts: gyro (3,) in rad/s, accel (3,) in m/s^2; NaN for ranges that the chip does not have.
static void convert(const gc_sample *sample, float *gyro, float *accel) {
  const bool known = sample->force_range < 4u && sample->rate_range < 5u;
  const float force = known ? GC_STANDARD_GRAVITY / COUNTS_PER_G[sample->force_range] : __builtin_nanf("");
  const float rate = known ? FULL_RATE[sample->rate_range] * (GC_DEGREE / GC_COUNTS) : force;
  for (uint32_t i = 0; i < 3u; ++i) {
    gyro[i] = rate * (float)sample->rate[i];
    accel[i] = force * (float)sample->force[i];
  }
}

// Return the time in s since the last sample, and follow its stamp, which wraps.
static float elapsed(gc_standalone *loop, uint32_t time) {
  const int32_t step = loop->has_sample ? (int32_t)(time - loop->time) : 0;
  const float period = loop->model.settings->period;
  // Stamps rise: a step back is a pause of more than half the counter's range.
  const float interval = step > 0 ? (float)step * 1e-6f : (step < 0 ? 2.0f * GC_PAUSE : period);
  loop->time = time;
  loop->stamp += step;
  loop->has_sample = true;
  return interval;
}

bool gc_standalone_weigh(gc_standalone *loop, int64_t stamp, const float *gyro, const float *accel) {
  const gc_settings *settings = loop->model.settings;
  float rate[3];
  gc_base_turn_acting(&loop->turn, settings, stamp, loop->turning);  // by the rates before, as on the host
  if (!gc_gravity_take(&loop->gravity, stamp, gyro, accel, loop->down)) {
    return false;
  }
  loop->has_gravity = true;
  gc_quaternion_rotate(loop->gravity.mount, loop->gravity.rate, rate);
  gc_base_turn_follow(&loop->turn, settings, stamp, rate);
  return true;
}

void gc_standalone_field(const gc_standalone *loop, float *field) {
  for (uint32_t i = 0; i < 3u; ++i) {
    field[i] = loop->down[i] + loop->turning[i];
  }
}

// Take the temperature and the counts of a sample. Returns whether gravity is known.
static bool weigh(gc_standalone *loop, const gc_sample *sample) {
  float gyro[3], accel[3];
  if (sample->temperature != GC_NO_READING) {
    gc_gravity_temperature(&loop->gravity, loop->stamp, 23.0f + 0.125f * (float)sample->temperature);
  }
  convert(sample, gyro, accel);
  (void)gc_standalone_weigh(loop, loop->stamp, gyro, accel);
  return loop->has_gravity;
}

// Write the command by motors. Returns false where a cable's motor is missing.
static bool by_motors(const gc_standalone *loop, uint8_t motors, float *displacement, float *tension) {
  for (uint32_t i = 0; i < loop->model.cables; ++i) {
    const uint32_t number = (uint32_t)gc_clamp(loop->model.settings->cable_motor[i], 0.0f, 8.0f);
    if (number == 0u || (motors & (1u << (number - 1u))) == 0u) {
      return false;
    }
    displacement[number - 1u] = loop->controller.displacement[i];
    tension[number - 1u] = loop->controller.tension[i];
  }
  return true;
}

void gc_standalone_follow(gc_standalone *loop, const float *gravity, float interval) {
  gc_equilibrium_step(&loop->equilibrium, gravity, loop->controller.displacement, interval, &loop->shape);
  const gc_target target = loop->joystick ? gc_target_joystick(loop->model.settings, loop->stick[0], loop->stick[1])
                                          : gc_target_stored(loop->model.settings);
  gc_inverse_step(&loop->controller, &loop->shape, &target, interval);
}

bool gc_standalone_step(gc_standalone *loop, const gc_sample *sample, uint8_t motors, float *displacement, float *tension) {
  if (!loop->loaded) {
    return false;
  }
  const float interval = elapsed(loop, sample->time);
  if (interval > GC_PAUSE) {  // the base may have turned anywhere
    gc_equilibrium_reset(&loop->equilibrium, &loop->model);
    gc_inverse_reset(&loop->controller, &loop->model);
  }
  if (!weigh(loop, sample)) {
    return false;
  }
  float field[3];
  gc_standalone_field(loop, field);
  gc_standalone_follow(loop, field, interval);
  return by_motors(loop, motors, displacement, tension);
}

bool gc_standalone_receive(void *context, const gc_frame *frame, gc_frame *reply) {
  gc_standalone *loop = (gc_standalone *)context;
  if (frame->id != GC_ID_JOYSTICK || !gc_frame_is_whole(frame, 8u) || frame->data[4] > 1u) {
    return false;
  }
  loop->stick[0] = (float)(int16_t)gc_get16(&frame->data[0]) / GC_COUNTS;
  loop->stick[1] = (float)(int16_t)gc_get16(&frame->data[2]) / GC_COUNTS;
  loop->joystick = frame->data[4] == 1u;
  *reply = gc_frame_of(GC_ID_LOOP_STATUS, 8u);
  reply->data[0] = (uint8_t)loop->controller.code;
  reply->data[1] = (uint8_t)loop->refusal;
  reply->data[2] = (uint8_t)loop->model.modes;
  reply->data[3] = (uint8_t)loop->controller.solver_steps;
  gc_put16(&reply->data[4], (uint16_t)gc_clamp(1e6f * loop->shape.left, 0.0f, 65535.0f));
  gc_frame_seal(reply);
  return true;
}
