// The state of the board, and its transitions:
//
//   IDLE --currents of the host--> FOLLOWING --host silent--> HOLDING --still silent--> RELEASED --currents--> FOLLOWING
//   IDLE, RELEASED, STANDALONE --home--> HOMING --> HOLDING or STANDALONE
//   IDLE, RELEASED, FOLLOWING, HOLDING after homing --run--> STANDALONE; FOLLOWING only where the board is between the buses
//   any --stall, runaway, a silent motor while the board drives--> FAULT --resume--> RELEASED
#ifndef GC_BOARD_STATE_H
#define GC_BOARD_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "frame.h"
#include "heater.h"
#include "homing.h"
#include "imu.h"
#include "motor.h"
#include "parameters.h"
#include "queue.h"
#include "storage.h"

#define GC_FIRMWARE_MAJOR 1u
#define GC_FIRMWARE_MINOR 1u

#define GC_ZERO_PERIOD 10000u  // us between two frames of zeros

typedef enum {
  GC_IDLE,        // no host has sent currents
  GC_FOLLOWING,   // the host's currents
  GC_HOLDING,     // the board holds the cables
  GC_RELEASED,    // zero current
  GC_FAULT,       // zero current until resume
  GC_HOMING,      // the board homes the cables
  GC_STANDALONE,  // the loop on the board
} gc_state;

enum {
  GC_FAULT_IMU = 0x0001,           // the IMU does not answer
  GC_FAULT_TEMPERATURE = 0x0002,   // no valid temperature reading: heater off
  GC_FAULT_HOT = 0x0004,           // above the limit of temperature: heater off
  GC_FAULT_HOST = 0x0008,          // the host stopped sending currents
  GC_FAULT_MOTOR_SILENT = 0x0010,  // a motor does not answer
  GC_FAULT_MOTOR = 0x0020,         // stall or runaway while the board drove
  GC_FAULT_CURRENT = 0x0040,       // the last clamp has limited a current
  GC_FAULT_STROKE = 0x0080,        // a cable is at the end of its stroke
  GC_FAULT_BUS = 0x0100,           // a bus is off, or was since the last state
  GC_FAULT_TWIN = 0x0200,          // another board sends the same frames
  GC_FAULT_PARAMETERS = 0x0400,    // no stored parameters: defaults
  GC_FAULT_WATCHDOG = 0x0800,      // the last reset came from the watchdog
  GC_FAULT_SUPPLY = 0x1000,        // the supply is too low, or caused the last reset
  GC_FAULT_MODEL = 0x2000,         // no whole model on the board
  GC_FAULT_HOMING = 0x4000,        // homing failed
  GC_FAULT_FRAMES = 0x8000,        // frames were lost because a queue was full
};

enum { GC_RESET_POWER, GC_RESET_SUPPLY, GC_RESET_WATCHDOG, GC_RESET_SOFTWARE, GC_RESET_PIN };

#define GC_BUSES 2u

// Takes a frame of the host for the controller; true when `reply` is to be sent.
typedef bool gc_receiver(void *context, const gc_frame *frame, gc_frame *reply);

typedef struct {
  gc_parameters parameters;
  gc_storage storage;
  uint32_t unique_id[3];
  uint32_t image_check;
  uint8_t reset_cause;
  bool has_controller;  // the loop on the board is there
  gc_receiver *receiver;
  void *receiver_context;

  uint32_t now;  // us
  gc_state state;
  uint32_t state_since;  // us
  uint16_t faults;       // that last until resume or restart
  uint16_t passing;      // since the last BoardState
  gc_imu imu;
  gc_heater heater;
  gc_motor motors[GC_MOTORS_MOST];
  gc_homing homing;
  gc_queue queues[GC_BUSES];
  bool bus_off[GC_BUSES];
  bool went_silent;     // the host has stopped
  bool begun;           // the robot without a PC has begun to home
  uint32_t host_time;   // us, of the last currents
  uint32_t sent;        // us, of the last currents to the motors
  bool pending;         // the host's currents wait for the next tick
  uint32_t twin_time;   // us
  uint32_t twins;       // frames of another board
  uint32_t next_drive;  // us
  uint32_t next_status;
  uint32_t next_state;
  uint32_t rejected;  // frames with a wrong length or check
  uint32_t slowest;   // us, longest tick, measured by the board
  bool supply_low;    // the supply is below its limit
  bool job_waits;     // the loop on the board has a sample to work on
  gc_sample job;
  uint32_t lost;      // frames that the buses' rings of reception had no room for, set before each tick
  uint32_t dropped;   // frames that were lost in rings or queues, as reported
  uint8_t clamped;    // motors whose current was limited since the last BoardState
  bool restart;       // a restart was requested
  bool reserved;      // the flash is written: no state begins in which the board drives
} gc_board;

// Whether the board is between the buses of host and motors.
bool gc_board_is_between(const gc_board *board);

// Bus of the motors: that of the host, or the other.
uint32_t gc_board_motor_bus(const gc_board *board);

// The motors that exist, a bit for each.
uint8_t gc_board_motors(const gc_board *board);

// Whether motor `index` + 1 exists.
bool gc_board_has_motor(const gc_board *board, uint32_t index);

// Whether there are motors and all of them answer.
bool gc_board_motors_answer(const gc_board *board);

// Whether currents go to the motors: those of the host, or of the board's own loops.
bool gc_board_drives(const gc_board *board);

// Frames that were lost because a queue or a ring was full.
uint32_t gc_board_lost(const gc_board *board);

// Keep the board from driving while the flash is written; false while it drives. Ends with gc_board_unreserve.
bool gc_board_reserve(gc_board *board);
void gc_board_unreserve(gc_board *board);

// Enter a state.
void gc_board_enter(gc_board *board, gc_state state);

// Home all cables; the caller has checked that the motors answer.
void gc_board_home(gc_board *board);

// Enter a state in which the board drives, from where the cables are.
void gc_board_hold_in(gc_board *board, gc_state state);

// Run the loop on the board; the caller has checked zero positions and motors.
void gc_board_run(gc_board *board);

#endif
