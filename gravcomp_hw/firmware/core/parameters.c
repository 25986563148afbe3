#include "parameters.h"

#include "crc.h"
#include "maths.h"

#define MAGIC 0x50434731u

typedef enum { WHOLE, REAL } kind;

typedef struct {
  kind kind;
  float lowest;
  float highest;
  float normal;
} description;

// In the order of the keys. The sum of the largest time-outs is 90 ms: a dead host is released within 100 ms.
static const description descriptions[GC_PARAMETER_COUNT] = {
    [GC_BOARD_NUMBER] = {WHOLE, 0.0f, 15.0f, 0.0f},
    [GC_WIRING] = {WHOLE, 0.0f, 1.0f, 0.0f},
    [GC_MOTORS] = {WHOLE, 0.0f, 255.0f, 0.0f},
    [GC_REVERSED] = {WHOLE, 0.0f, 255.0f, 0.0f},
    [GC_TWO_WAY] = {WHOLE, 0.0f, 255.0f, 0.0f},
    [GC_CURRENT_LIMIT] = {WHOLE, 0.0f, 10000.0f, 1000.0f},
    [GC_CURRENT_CONTINUOUS] = {WHOLE, 0.0f, 10000.0f, 3000.0f},
    [GC_HEATING_TIME] = {WHOLE, 100.0f, 600000.0f, 10000.0f},
    [GC_HOST_TIMEOUT] = {WHOLE, 10.0f, 50.0f, 50.0f},
    [GC_HOLD_TIME] = {WHOLE, 0.0f, 40.0f, 40.0f},
    [GC_TRAVEL_PER_COUNT] = {REAL, 1e-9f, 1e-3f, 1.0652643e-7f},
    [GC_DISPLACEMENT_MIN] = {REAL, -1.0f, 0.0f, -0.03f},
    [GC_DISPLACEMENT_MAX] = {REAL, 0.0f, 1.0f, 0.03f},
    [GC_VELOCITY_LIMIT] = {REAL, 1e-4f, 0.25f, 0.04f},
    [GC_ACCELERATION_LIMIT] = {REAL, 0.01f, 50.0f, 0.2f},
    [GC_POSITION_GAIN] = {REAL, 0.1f, 200.0f, 25.0f},
    [GC_VELOCITY_GAIN] = {REAL, 0.1f, 5000.0f, 90.0f},
    [GC_VELOCITY_INTEGRAL] = {REAL, 0.0f, 1e5f, 1500.0f},
    [GC_NEWTON_PER_AMPERE] = {REAL, 0.02f, 20000.0f, 36.0f},
    [GC_TENSION_LIMIT] = {REAL, 0.0f, 1000.0f, 5.0f},
    [GC_PRETENSION] = {REAL, 0.0f, 20.0f, 0.0f},
    [GC_HEATER_LIMIT] = {WHOLE, 0.0f, 10000.0f, 10000.0f},
    [GC_HEATER_HOT] = {WHOLE, 20.0f, 65.0f, 65.0f},
    [GC_ACCELEROMETER_RANGE] = {WHOLE, 0.0f, 3.0f, 1.0f},
    [GC_GYROSCOPE_RANGE] = {WHOLE, 0.0f, 4.0f, 0.0f},
    [GC_HOMING_VELOCITY] = {REAL, 1e-4f, 0.05f, 0.004f},
    [GC_HOMING_RISE] = {WHOLE, 5.0f, 5000.0f, 60.0f},
    [GC_HOMING_TRAVEL] = {REAL, 1e-3f, 0.3f, 0.03f},
    [GC_HOMING_SLACK] = {REAL, 5e-4f, 0.02f, 0.005f},
    [GC_FOLLOWING_ERROR] = {REAL, 1e-4f, 0.1f, 0.006f},
    [GC_OVERSPEED] = {REAL, 1.2f, 10.0f, 2.0f},
    [GC_STALL_TIME] = {WHOLE, 20.0f, 5000.0f, 180.0f},
    [GC_AT_START] = {WHOLE, 0.0f, 1.0f, 0.0f},
    [GC_HEATER_OWN] = {WHOLE, 0.0f, 1.0f, 0.0f},
    [GC_HEATER_TARGET] = {WHOLE, 0.0f, 60.0f, 0.0f},
    [GC_HEATER_RISE] = {WHOLE, 0.0f, 40.0f, 15.0f},
    [GC_HEATER_GAIN] = {REAL, 0.0f, 10.0f, 0.25f},
    [GC_HEATER_INTEGRAL_TIME] = {REAL, 0.1f, 10000.0f, 40.0f},
    [GC_BACKLASH] = {REAL, 0.0f, 0.1f, 5.2359878e-5f},
    [GC_TAKE_UP_TIME] = {REAL, 0.0f, 60.0f, 0.3f},
};

static bool fits(uint32_t key, uint32_t word) {
  const description *own = &descriptions[key];
  if (own->kind == WHOLE) {
    return (uint32_t)own->lowest <= word && word <= (uint32_t)own->highest;
  }
  const float value = gc_float_of(word);
  return gc_finite(value) && own->lowest <= value && value <= own->highest;
}

void gc_parameters_default(gc_parameters *parameters) {
  for (uint32_t key = 0; key < (uint32_t)GC_PARAMETER_COUNT; key++) {
    const description *own = &descriptions[key];
    parameters->words[key] = own->kind == WHOLE ? (uint32_t)own->normal : gc_bits_of(own->normal);
  }
}

int32_t gc_parameter_int(const gc_parameters *parameters, uint32_t key) { return (int32_t)parameters->words[key]; }

float gc_parameter_real(const gc_parameters *parameters, uint32_t key) {
  return gc_float_of(parameters->words[key]);
}

bool gc_parameter_set(gc_parameters *parameters, uint32_t key, uint32_t word) {
  if (key >= (uint32_t)GC_PARAMETER_COUNT || !fits(key, word)) {
    return false;
  }
  parameters->words[key] = word;
  return true;
}

gc_parameter_record gc_parameter_record_of(const gc_parameters *parameters, uint32_t sequence) {
  gc_parameter_record record = {.magic = MAGIC, .version = GC_PARAMETER_VERSION, .sequence = sequence};
  record.parameters = *parameters;
  record.check = gc_crc32(0u, (const uint8_t *)&record, offsetof(gc_parameter_record, check));
  return record;
}

bool gc_parameter_record_is_whole(const gc_parameter_record *record) {
  if (record->magic != MAGIC || record->version != GC_PARAMETER_VERSION) {
    return false;
  }
  if (record->check != gc_crc32(0u, (const uint8_t *)record, offsetof(gc_parameter_record, check))) {
    return false;
  }
  for (uint32_t key = 0; key < (uint32_t)GC_PARAMETER_COUNT; key++) {
    if (!fits(key, record->parameters.words[key])) {
      return false;
    }
  }
  return true;
}
