#include "heater_control.h"

#include "maths.h"

#define FULL 10000.0f
#define COUNTS_PER_DEGREE 8.0f
#define ZERO_DEGREES 23.0f
#define WARMEST_AMBIENT 56  // reading of 30 degC; a first reading above it comes from a chip that is still warm

static float target(const gc_heater_control *control, const gc_parameters *parameters) {
  const int32_t fixed = gc_parameter_int(parameters, GC_HEATER_TARGET);
  if (fixed > 0) {
    return (float)fixed;
  }
  return ZERO_DEGREES + (float)control->ambient / COUNTS_PER_DEGREE + (float)gc_parameter_int(parameters, GC_HEATER_RISE);
}

void gc_heater_control_rest(gc_heater_control *control) {
  control->integral = 0.0f;
  control->duty = 0u;
  control->time = 0u;
}

uint16_t gc_heater_control_step(gc_heater_control *control, const gc_parameters *parameters, int16_t reading, uint32_t now) {
  if (!control->begun) {
    control->begun = true;
    control->ambient = reading < WARMEST_AMBIENT ? reading : (int16_t)WARMEST_AMBIENT;
  }
  const bool first = control->time == 0u;
  if (!first && now - control->time < GC_READING_PERIOD) {
    return control->duty;
  }
  const float gain = gc_parameter_real(parameters, GC_HEATER_GAIN);
  const float time = gc_parameter_real(parameters, GC_HEATER_INTEGRAL_TIME);
  const float elapsed = first ? 1e-6f * (float)GC_READING_PERIOD : gc_min(1e-6f * (float)(now - control->time), 2.56f);
  const float error = target(control, parameters) - (ZERO_DEGREES + (float)reading / COUNTS_PER_DEGREE);
  const float integral = control->integral + gain / time * error * elapsed;
  const float wanted = gain * error + integral, output = gc_clamp(wanted, 0.0f, 1.0f);
  if (!((wanted - output) * error > 0.0f)) {  // else the limit is active, and the error would drive it further
    control->integral = integral;
  }
  control->time = now == 0u ? 1u : now;
  control->duty = (uint16_t)(FULL * output + 0.5f);
  return control->duty;
}
