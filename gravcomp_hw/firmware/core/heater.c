#include "heater.h"

#define FULL 10000u
#define ZERO_DEGREES (-23)    // degC; what the offset of the reading takes off
#define HYSTERESIS 40         // 5 degC
#define COLDEST (-544)        // -45 degC
#define WARMEST 856           // 130 degC

void gc_heater_command(gc_heater *heater, uint16_t duty, uint32_t now) {
  heater->commanded = duty > FULL ? (uint16_t)FULL : duty;
  heater->command_time = now;
  heater->commanded_once = true;
}

void gc_heater_read(gc_heater *heater, int16_t reading, uint32_t now) {
  if (reading < COLDEST || reading > WARMEST) {
    return;
  }
  heater->reading = reading;
  heater->reading_time = now;
  heater->read_once = true;
}

void gc_heater_tick(gc_heater *heater, const gc_parameters *parameters, uint32_t now) {
  const int32_t limit = (gc_parameter_int(parameters, GC_HEATER_HOT) + ZERO_DEGREES) * 8;
  if (heater->commanded_once && now - heater->command_time > GC_HEATER_TIMEOUT) {
    heater->commanded_once = false;  // a clock that wraps must not make an old command fresh
  }
  if (heater->read_once && now - heater->reading_time > GC_SENSOR_TIMEOUT) {
    heater->read_once = false;
  }
  const bool own = !heater->commanded_once && gc_parameter_int(parameters, GC_HEATER_OWN) == 1;
  heater->expired = !heater->commanded_once && !own;
  heater->unread = !heater->read_once;
  heater->hot = heater->reading > (heater->hot ? limit - HYSTERESIS : limit);
  const uint16_t most = (uint16_t)gc_parameter_int(parameters, GC_HEATER_LIMIT);
  const bool off = heater->expired || heater->unread || heater->hot;
  uint16_t wanted = heater->commanded;
  if (own && !off) {
    wanted = gc_heater_control_step(&heater->control, parameters, heater->reading, now);
  } else {
    gc_heater_control_rest(&heater->control);
  }
  heater->duty = off ? 0u : (wanted < most ? wanted : most);
}
