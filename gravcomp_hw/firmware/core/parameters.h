// Parameters of the board: 32-bit words, whole numbers or float32, each with a range; and the record that is stored.
#ifndef GC_PARAMETERS_H
#define GC_PARAMETERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
  GC_BOARD_NUMBER,        // which board of several
  GC_WIRING,              // 0: one bus; 1: between host (bus 0) and motors (bus 1)
  GC_MOTORS,              // bit k: motor k + 1 exists
  GC_REVERSED,            // bit k: motor k + 1 pulls in with negative counts
  GC_TWO_WAY,             // bit k: motor k + 1 pulls an antagonist when it turns back
  GC_CURRENT_LIMIT,       // mA
  GC_CURRENT_CONTINUOUS,  // mA
  GC_HEATING_TIME,        // ms, time constant of a motor's winding
  GC_HOST_TIMEOUT,        // ms without currents from the host until the board holds
  GC_HOLD_TIME,           // ms of holding until it releases
  GC_TRAVEL_PER_COUNT,    // m of cable for a count of the rotor
  GC_DISPLACEMENT_MIN,    // m
  GC_DISPLACEMENT_MAX,    // m
  GC_VELOCITY_LIMIT,      // m/s
  GC_ACCELERATION_LIMIT,  // m/s^2
  GC_POSITION_GAIN,       // 1/s
  GC_VELOCITY_GAIN,       // A s/m
  GC_VELOCITY_INTEGRAL,   // A/m
  GC_NEWTON_PER_AMPERE,   // N/A at the cable
  GC_TENSION_LIMIT,       // N
  GC_PRETENSION,          // N
  GC_HEATER_LIMIT,        // largest duty, 0.0001
  GC_HEATER_HOT,          // degC above which the heater is off
  GC_ACCELEROMETER_RANGE,
  GC_GYROSCOPE_RANGE,
  GC_HOMING_VELOCITY,  // m/s
  GC_HOMING_RISE,      // mA
  GC_HOMING_TRAVEL,    // m
  GC_HOMING_SLACK,     // m
  GC_FOLLOWING_ERROR,  // m from the setpoint: runaway
  GC_OVERSPEED,        // multiple of the velocity limit: runaway
  GC_STALL_TIME,       // ms at the current limit without motion
  GC_AT_START,         // 0: wait for a host; 1: home, then run the loop on the board
  GC_HEATER_OWN,       // 1: without commands of a host the board controls the IMU's temperature itself
  GC_HEATER_TARGET,    // degC; 0: GC_HEATER_RISE above the first reading
  GC_HEATER_RISE,      // degC
  GC_HEATER_GAIN,      // 1/degC
  GC_HEATER_INTEGRAL_TIME,  // s
  GC_BACKLASH,      // m of cable, of the gear
  GC_TAKE_UP_TIME,  // s of rest of a target after which the loop on the board takes up the backlash; 0: never
  GC_PARAMETER_COUNT
};

#define GC_PARAMETER_VERSION 3u

typedef struct {
  uint32_t words[GC_PARAMETER_COUNT];
} gc_parameters;

// What is stored. `check` is the CRC-32 of everything before it.
typedef struct {
  uint32_t magic;
  uint32_t version;
  uint32_t sequence;  // the newer of two records has the larger one
  gc_parameters parameters;
  uint32_t check;
} gc_parameter_record;

void gc_parameters_default(gc_parameters *parameters);

int32_t gc_parameter_int(const gc_parameters *parameters, uint32_t key);

float gc_parameter_real(const gc_parameters *parameters, uint32_t key);

// Set a word; false, and no change, for an unknown key or a value out of range.
bool gc_parameter_set(gc_parameters *parameters, uint32_t key, uint32_t word);

gc_parameter_record gc_parameter_record_of(const gc_parameters *parameters, uint32_t sequence);

// Whether the record is whole, of this version, and has each value in its range.
bool gc_parameter_record_is_whole(const gc_parameter_record *record);

#endif
