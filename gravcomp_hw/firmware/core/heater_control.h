// The board's own control of the IMU's temperature, for a robot without a host: u = Kp e + I, dI/dt = Kp / Ti e, once for each renewal
// of the chip's reading (src/gravcomp/thermal/pid.py and heater.py). The target is fixed, or a rise above the first reading.
#ifndef GC_HEATER_CONTROL_H
#define GC_HEATER_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"

#define GC_READING_PERIOD 1280000u  // us after which the chip renews its reading

// Zero is the state before the first reading.
typedef struct {
  bool begun;
  int16_t ambient;  // reading
  uint32_t time;    // us, of the last step
  float integral;
  uint16_t duty;    // 0.0001
} gc_heater_control;

// Return the duty (0.0001) for a valid reading (0.125 degC, 0 is 23 degC).
uint16_t gc_heater_control_step(gc_heater_control *control, const gc_parameters *parameters, int16_t reading, uint32_t now);

// Forget the integral, so that the control begins again when it is needed; what was learned of the ambient stays.
void gc_heater_control_rest(gc_heater_control *control);

#endif
