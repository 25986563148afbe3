#include "board.h"

#include <stddef.h>

#include "maths.h"
#include "request.h"

#define STATUS_PERIOD 100000u  // us
#define STATE_OFFSET 50000u    // us; BoardState half a period after BoardStatus
#define DRIVE_PERIOD 2000u     // us, of the board's own loops
#define ZERO_TIME 1000000u     // us for which a board on the motors' bus sends zeros after its host has died
#define START_TIME 1000000u    // us; the motors' controllers start meanwhile
#define TWIN_FRAMES 3u         // whole frames of another board
#define TWIN_TIME 1000000u     // us without such frames until they are forgotten
#define MOTORS_A_FRAME 4u

enum { STATUS_SILENT_IMU = 1, STATUS_HOT = 2, STATUS_NO_COMMAND = 4 };

static const uint16_t current_ids[2] = {GC_ID_CURRENTS_1_TO_4, GC_ID_CURRENTS_5_TO_8};

// Whether the board's own loops drive the motors.
static bool drives_itself(const gc_board *board) {
  return board->state == GC_HOLDING || board->state == GC_HOMING || board->state == GC_STANDALONE;
}

void gc_board_start(gc_board *board) {
  gc_parameters_default(&board->parameters);
  if (board->storage.erase == NULL || !gc_storage_load(&board->storage, &board->parameters)) {
    board->faults |= GC_FAULT_PARAMETERS;
  }
  if (board->reset_cause == GC_RESET_WATCHDOG) {
    board->faults |= GC_FAULT_WATCHDOG;
  }
  if (board->reset_cause == GC_RESET_SUPPLY) {
    board->faults |= GC_FAULT_SUPPLY;
  }
  board->imu.answers = true;
  board->heater.reading = GC_NO_READING;
  board->next_status = STATUS_PERIOD;
  // Two boards with one number do not send their states at the same time for ever.
  board->next_state = STATE_OFFSET + (board->unique_id[0] ^ board->unique_id[1] ^ board->unique_id[2]) % 40u * 1000u;
  gc_board_enter(board, GC_RELEASED);  // a C610 holds the last current that it got before the restart
}

// Currents to the motors: the wanted ones through the last clamp, zero for motors that do not exist or do not answer.
static void send_currents(gc_board *board) {
  const bool driving = board->state == GC_FOLLOWING || drives_itself(board);
  for (uint32_t group = 0; group < 2u; group++) {
    gc_frame frame = gc_frame_of(current_ids[group], 8u);
    bool any = false;
    for (uint32_t k = 0; k < MOTORS_A_FRAME; k++) {
      const uint32_t index = MOTORS_A_FRAME * group + k;
      gc_motor *motor = &board->motors[index];
      if (!gc_board_has_motor(board, index)) {
        continue;
      }
      any = true;
      if (!driving || !gc_rotor_answers(&motor->rotor, board->now)) {
        motor->wanted = 0;
      }
      gc_put16(&frame.data[2u * k], (uint16_t)gc_motor_clamp(motor, &board->parameters, index));
      if (motor->clamped) {
        board->clamped |= (uint8_t)(1u << index);
        board->passing |= GC_FAULT_CURRENT;
      }
      if (motor->at_stroke) {
        board->passing |= GC_FAULT_STROKE;
      }
    }
    if (any) {
      gc_queue_put(&board->queues[gc_board_motor_bus(board)], &frame);
    }
  }
  board->sent = board->now;
  board->pending = false;
}

static void take_host_currents(gc_board *board, uint32_t group, const gc_frame *frame) {
  board->host_time = board->now;
  board->went_silent = false;
  for (uint32_t k = 0; k < MOTORS_A_FRAME; k++) {
    const uint32_t index = MOTORS_A_FRAME * group + k;
    if (gc_board_has_motor(board, index) && board->state != GC_HOMING && board->state != GC_STANDALONE) {
      board->motors[index].wanted = (int16_t)gc_get16(&frame->data[2u * k]);
    }
  }
  const bool free = board->state == GC_IDLE || board->state == GC_RELEASED || board->state == GC_HOLDING;
  if (free && !board->supply_low && !board->reserved) {
    gc_board_enter(board, GC_FOLLOWING);
  }
  if (board->state == GC_FOLLOWING && gc_board_is_between(board)) {
    board->pending = true;
  }
}

static void take_feedback(gc_board *board, uint32_t index, const gc_frame *frame) {
  gc_motor *motor = &board->motors[index];
  const uint16_t angle = gc_get16(frame->data);
  const int16_t speed = (int16_t)gc_get16(&frame->data[2]);
  const int16_t current = (int16_t)gc_get16(&frame->data[4]);
  const bool knew = motor->rotor.seen;
  if (!gc_rotor_update(&motor->rotor, angle, speed, current, board->now)) {
    board->rejected++;
  }
  if (!knew && motor->rotor.seen) {
    motor->zero_known = false;  // it counts from another turn
  }
  if (gc_board_is_between(board)) {
    gc_queue_put(&board->queues[0], frame);
  }
}

static void take_from_board(gc_board *board, const gc_frame *frame) {
  if (!gc_frame_is_whole(frame, 8u)) {
    return;
  }
  board->twins = board->twins < TWIN_FRAMES ? board->twins + 1u : TWIN_FRAMES;
  board->twin_time = board->now;
}

static bool is_twin(const gc_board *board) { return board->twins >= TWIN_FRAMES; }

static void take_from_host(gc_board *board, const gc_frame *frame) {
  if (frame->id == GC_ID_CURRENTS_1_TO_4 || frame->id == GC_ID_CURRENTS_5_TO_8) {
    if (frame->length == 8u) {
      take_host_currents(board, frame->id == GC_ID_CURRENTS_1_TO_4 ? 0u : 1u, frame);
    } else {
      board->rejected++;
    }
  } else if (frame->id == GC_ID_HEATER) {
    if (gc_frame_is_whole(frame, 4u)) {
      gc_heater_command(&board->heater, gc_get16(frame->data), board->now);
    } else {
      board->rejected++;
    }
  } else if (frame->id == GC_ID_REQUEST) {
    if (gc_frame_is_whole(frame, 8u)) {
      gc_request_take(board, frame);
    } else {
      board->rejected++;
    }
  } else if (frame->id >= GC_ID_MODEL_FIRST && frame->id <= GC_ID_MODEL_LAST && board->receiver != NULL) {
    gc_frame reply;
    if (board->receiver(board->receiver_context, frame, &reply)) {
      gc_queue_put(&board->queues[0], &reply);
    }
  } else {
    // Frames of no concern: CommandTrace, other devices.
  }
}

void gc_board_receive(gc_board *board, uint32_t bus, const gc_frame *frame) {
  if (bus >= GC_BUSES || frame->extended != 0u || frame->length > 8u) {
    return;
  }
  const uint32_t motor = (uint32_t)frame->id - (uint32_t)GC_ID_FEEDBACK - 1u;
  if (motor < GC_MOTORS_MOST) {
    if (bus == gc_board_motor_bus(board) && frame->length == 8u && gc_board_has_motor(board, motor)) {
      take_feedback(board, motor, frame);
    }
    return;
  }
  if (bus != 0u) {
    return;
  }
  if (frame->id >= GC_ID_ACCELEROMETER && frame->id <= GC_ID_BOARD_LAST) {
    take_from_board(board, frame);
  } else {
    take_from_host(board, frame);
  }
}

void gc_board_sample(gc_board *board, const gc_sample *sample) {
  gc_sample own = *sample;
  own.force_range = (uint8_t)gc_parameter_int(&board->parameters, GC_ACCELEROMETER_RANGE);
  own.rate_range = (uint8_t)gc_parameter_int(&board->parameters, GC_GYROSCOPE_RANGE);
  gc_heater_read(&board->heater, own.temperature, board->now);
  gc_frame frames[3];
  gc_imu_frames(&board->imu, &own, frames);
  if (!is_twin(board)) {
    for (uint32_t i = 0; i < 3u; i++) {
      gc_queue_put(&board->queues[0], &frames[i]);
    }
  }
  if (board->state == GC_STANDALONE) {
    board->job = own;
    board->job_waits = true;
  }
}

bool gc_board_job(gc_board *board, gc_sample *sample) {
  const bool waits = board->job_waits;
  *sample = board->job;
  board->job_waits = false;
  return waits;
}

void gc_board_targets(gc_board *board, const float *displacement, const float *tension) {
  const float least = gc_parameter_real(&board->parameters, GC_DISPLACEMENT_MIN);
  const float most = gc_parameter_real(&board->parameters, GC_DISPLACEMENT_MAX);
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    const bool usable = gc_finite(displacement[index]) && gc_finite(tension[index]);
    if (board->state == GC_STANDALONE && gc_board_has_motor(board, index) && usable) {
      board->motors[index].target = gc_clamp(displacement[index], least, most);
      board->motors[index].tension = tension[index];
    }
  }
}

void gc_board_supply(gc_board *board, bool low) {
  if (low && !board->supply_low && board->state != GC_IDLE && board->state != GC_FAULT) {
    gc_board_enter(board, GC_RELEASED);
  }
  board->supply_low = low;
}

void gc_board_bus_off(gc_board *board, uint32_t bus, bool off) {
  if (bus < GC_BUSES) {
    board->bus_off[bus] = off;
    if (off) {
      board->passing |= GC_FAULT_BUS;
    }
  }
}

bool gc_board_transmit(gc_board *board, uint32_t bus, gc_frame *frame) {
  return bus < GC_BUSES && gc_queue_take(&board->queues[bus], frame);
}

static bool has_current(const gc_board *board) {
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    if (board->motors[index].current != 0 || board->motors[index].wanted != 0) {
      return true;
    }
  }
  return false;
}

// A host that stops sending: hold, then release. On the bus of the motors the board does not hold, because a guard of the host may
// send zeros there at the same time.
static void watch_host(gc_board *board) {
  const uint32_t timeout = 1000u * (uint32_t)gc_parameter_int(&board->parameters, GC_HOST_TIMEOUT);
  const uint32_t holding = 1000u * (uint32_t)gc_parameter_int(&board->parameters, GC_HOLD_TIME);
  if (board->state == GC_FOLLOWING && board->now - board->host_time >= timeout) {
    board->went_silent = true;
    const bool current = has_current(board);
    if (current && gc_board_is_between(board)) {
      gc_board_hold_in(board, GC_HOLDING);
    } else if (!current || board->now - board->host_time >= timeout + holding) {
      gc_board_enter(board, GC_RELEASED);
    } else {
      // The hold time passes.
    }
  } else if (board->state == GC_HOLDING && board->went_silent && board->now - board->host_time >= timeout + holding) {
    gc_board_enter(board, GC_RELEASED);
  } else {
    // The host is there, or the board does not follow it.
  }
}

// Whether zeros meet no currents of a host on the same bus.
static bool host_is_away(const gc_board *board) {
  const uint32_t timeout = 1000u * (uint32_t)gc_parameter_int(&board->parameters, GC_HOST_TIMEOUT);
  return gc_board_is_between(board) || (board->now - board->host_time >= timeout && board->now >= timeout);
}

static void watch_motors(gc_board *board) {
  bool silent = false;
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    gc_motor *motor = &board->motors[index];
    if (gc_rotor_forget(&motor->rotor, board->now)) {
      motor->zero_known = false;
    }
    silent = silent || (gc_board_has_motor(board, index) && !gc_rotor_answers(&motor->rotor, board->now));
    gc_motor_warm(motor, &board->parameters, 1e-6f * (float)GC_TICK);
  }
  const bool own = drives_itself(board);
  if (silent && (own || board->state == GC_FOLLOWING)) {
    board->passing |= GC_FAULT_MOTOR_SILENT;
  }
  if (silent && own) {
    board->faults |= GC_FAULT_MOTOR_SILENT;
    gc_board_enter(board, GC_FAULT);
  }
}

static void finish_homing(gc_board *board) {
  if (board->homing.phase == GC_HOMING_FAILED) {
    board->faults |= GC_FAULT_HOMING;
    gc_board_enter(board, GC_FAULT);
  } else if (board->homing.phase == GC_HOMED) {
    if (gc_parameter_int(&board->parameters, GC_AT_START) == 1 && board->has_controller) {
      gc_board_run(board);
    } else {
      board->went_silent = false;  // held until the host takes over
      gc_board_hold_in(board, GC_HOLDING);
    }
  } else {
    // It goes on.
  }
}

// The board's own loops in the states in which it drives.
static void drive(gc_board *board) {
  const float dt = 1e-6f * (float)DRIVE_PERIOD;
  const bool homing = board->state == GC_HOMING;
  const uint32_t limit = homing ? (uint32_t)GC_HOMING_VELOCITY : (uint32_t)GC_VELOCITY_LIMIT;
  const float fastest = gc_parameter_real(&board->parameters, limit);
  if (homing) {
    gc_homing_step(&board->homing, board->motors, &board->parameters, gc_board_motors(board), dt);
  }
  gc_motors_act_together(board->motors, &board->parameters, gc_board_motors(board));
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    if (!gc_board_has_motor(board, index)) {
      continue;
    }
    gc_motor *motor = &board->motors[index];
    if (board->state == GC_STANDALONE) {
      gc_motor_follow(motor, &board->parameters, index, dt);
    } else {
      gc_motor_drive(motor, &board->parameters, index, dt, fastest);
    }
    if (gc_motor_is_astray(motor, &board->parameters, index, dt)) {
      board->faults |= GC_FAULT_MOTOR;
      gc_board_enter(board, GC_FAULT);
      return;
    }
  }
  send_currents(board);
  if (homing) {
    finish_homing(board);
  }
}

static void send_status(gc_board *board) {
  gc_frame frame = gc_frame_of(GC_ID_STATUS, 8u);
  frame.data[0] = GC_PROTOCOL;
  frame.data[1] = GC_FIRMWARE_MAJOR;
  frame.data[2] = GC_FIRMWARE_MINOR;
  frame.data[3] = (uint8_t)gc_parameter_int(&board->parameters, GC_ACCELEROMETER_RANGE);
  frame.data[4] = (uint8_t)gc_parameter_int(&board->parameters, GC_GYROSCOPE_RANGE);
  frame.data[5] = (uint8_t)(((uint32_t)board->heater.duty * 255u + 5000u) / 10000u);
  frame.data[6] = (uint8_t)((board->imu.answers ? 0u : (uint32_t)STATUS_SILENT_IMU) |
                            (board->heater.hot ? (uint32_t)STATUS_HOT : 0u) |
                            (board->heater.expired ? (uint32_t)STATUS_NO_COMMAND : 0u));
  gc_frame_seal(&frame);
  if (!is_twin(board)) {
    gc_queue_put(&board->queues[0], &frame);
  }
}

uint16_t gc_board_faults(const gc_board *board) {
  uint32_t faults = (uint32_t)board->faults | board->passing;
  faults |= board->imu.answers ? 0u : (uint32_t)GC_FAULT_IMU;
  faults |= board->heater.unread ? (uint32_t)GC_FAULT_TEMPERATURE : 0u;
  faults |= board->heater.hot ? (uint32_t)GC_FAULT_HOT : 0u;
  faults |= board->went_silent ? (uint32_t)GC_FAULT_HOST : 0u;
  faults |= board->bus_off[0] || board->bus_off[1] ? (uint32_t)GC_FAULT_BUS : 0u;
  faults |= board->supply_low ? (uint32_t)GC_FAULT_SUPPLY : 0u;
  faults |= is_twin(board) ? (uint32_t)GC_FAULT_TWIN : 0u;
  return (uint16_t)faults;
}

static void send_state(gc_board *board) {
  gc_frame frame = gc_frame_of(GC_ID_STATE, 8u);
  frame.data[0] = (uint8_t)gc_parameter_int(&board->parameters, GC_BOARD_NUMBER);
  frame.data[1] = (uint8_t)board->state;
  gc_put16(&frame.data[2], gc_board_faults(board));
  frame.data[4] = board->clamped;
  frame.data[5] = board->reset_cause;
  frame.data[6] = (uint8_t)board->rejected;
  gc_frame_seal(&frame);
  gc_queue_put(&board->queues[0], &frame);
  board->passing = 0u;
  board->clamped = 0u;
}

// The robot without a PC begins when its motors answer.
static void begin_alone(gc_board *board) {
  if (board->begun || gc_parameter_int(&board->parameters, GC_AT_START) != 1 || board->now < START_TIME) {
    return;
  }
  if (gc_board_motors_answer(board) && !board->supply_low && !board->reserved && board->state != GC_FAULT) {
    board->begun = true;
    gc_board_home(board);
  }
}

static void watch_twin(gc_board *board) {
  if (board->now - board->twin_time > TWIN_TIME) {
    board->twins = 0u;
  }
}

static void watch_queues(gc_board *board) {
  if (gc_board_lost(board) != board->dropped) {
    board->dropped = gc_board_lost(board);
    board->passing |= GC_FAULT_FRAMES;
  }
}

void gc_board_tick(gc_board *board, uint32_t now) {
  board->now = now;
  gc_imu_watch(&board->imu, now);
  gc_heater_tick(&board->heater, &board->parameters, now);
  if (board->supply_low) {
    board->heater.duty = 0u;
  }
  watch_motors(board);
  watch_host(board);
  if (drives_itself(board) && (int32_t)(now - board->next_drive) >= 0) {
    board->next_drive = now + DRIVE_PERIOD;
    drive(board);
  }
  if (board->state == GC_FOLLOWING && board->pending) {
    send_currents(board);
  }
  const bool still = board->state == GC_RELEASED || board->state == GC_FAULT;
  if (still && host_is_away(board) && now - board->sent >= GC_ZERO_PERIOD) {
    send_currents(board);
    if (!gc_board_is_between(board) && board->state == GC_RELEASED && now - board->state_since >= ZERO_TIME) {
      gc_board_enter(board, GC_IDLE);
    }
  }
  begin_alone(board);
  watch_twin(board);
  watch_queues(board);
  if ((int32_t)(now - board->next_status) >= 0) {
    board->next_status += STATUS_PERIOD;
    send_status(board);
  }
  if ((int32_t)(now - board->next_state) >= 0) {
    board->next_state += STATUS_PERIOD;
    send_state(board);
  }
}
