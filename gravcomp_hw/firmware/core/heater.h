// The heater of the IMU: the host commands its duty, or without a host the board itself where it is told to. The board limits it and
// switches it off by itself.
#ifndef GC_HEATER_H
#define GC_HEATER_H

#include <stdbool.h>
#include <stdint.h>

#include "heater_control.h"
#include "parameters.h"

#define GC_HEATER_TIMEOUT 500000u   // us without a command until the heater is off
#define GC_SENSOR_TIMEOUT 1500000u  // us without a valid reading until the heater is off

#define GC_NO_READING INT16_MIN  // what the reader gives where the chip has no temperature

typedef struct {
  uint16_t commanded;  // 0.0001
  uint16_t duty;       // 0.0001, in effect
  int16_t reading;     // 0.125 degC, 0 is 23 degC
  uint32_t command_time;
  uint32_t reading_time;
  bool commanded_once;
  bool read_once;
  bool hot;      // switched off by temperature, until 5 degC below the limit
  bool unread;   // switched off because no valid reading comes
  bool expired;  // no fresh command, and the board does not control it itself
  gc_heater_control control;
} gc_heater;

// Take a commanded duty (0.0001; more than 10000 counts as 10000).
void gc_heater_command(gc_heater *heater, uint16_t duty, uint32_t now);

// Take a reading of the chip; GC_NO_READING and values that the chip cannot have do not count.
void gc_heater_read(gc_heater *heater, int16_t reading, uint32_t now);

// Decide the duty.
void gc_heater_tick(gc_heater *heater, const gc_parameters *parameters, uint32_t now);

#endif
