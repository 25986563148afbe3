#include "loop.h"

#include "../../core/memory.h"

size_t gc_loop_size(void) { return sizeof(gc_standalone); }

size_t gc_loop_settings(void) { return sizeof(gc_settings) / sizeof(float); }

uint32_t gc_loop_load(gc_standalone *loop, const uint8_t *blob, size_t size) {
  (void)gc_standalone_take(loop, blob, size, gc_model_magic(blob, size), NULL);
  return (uint32_t)loop->refusal;
}

bool gc_loop_weigh(gc_standalone *loop, int64_t stamp, const float *gyro, const float *accel) {
  return gc_standalone_weigh(loop, stamp, gyro, accel);
}

bool gc_loop_follow(gc_standalone *loop, const float *gravity, float interval) {
  if (gravity == NULL && !loop->has_gravity) {
    return false;
  }
  float field[3];
  gc_standalone_field(loop, field);
  gc_standalone_follow(loop, gravity != NULL ? gravity : field, interval);
  return true;
}

void gc_loop_joystick(gc_standalone *loop, float x, float y) {
  loop->joystick = true;
  loop->stick[0] = x;
  loop->stick[1] = y;
}

void gc_loop_read(const gc_standalone *loop, gc_loop_result *result) {
  gc_zero(result, sizeof *result);
  gc_copy(result->gravity, loop->down, sizeof result->gravity);
  gc_copy(result->turning, loop->turning, sizeof result->turning);
  gc_copy(result->tip, loop->shape.tip, sizeof result->tip);
  gc_copy(result->displacement, loop->controller.displacement, sizeof result->displacement);
  gc_copy(result->tension, loop->controller.tension, sizeof result->tension);
  result->left = loop->shape.left;
  result->code = (uint32_t)loop->controller.code;
  result->converged = loop->shape.converged ? 1u : 0u;
  result->solver_steps = loop->controller.solver_steps;
  result->cables = loop->model.cables;
}
