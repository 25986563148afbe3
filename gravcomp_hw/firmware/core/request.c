#include "request.h"

#include <stddef.h>

#define OPERATION_SHIFT 4u

static uint8_t read(const gc_board *board, uint32_t key, uint32_t *value) {
  if (key < (uint32_t)GC_PARAMETER_COUNT) {
    *value = board->parameters.words[key];
    return GC_DONE;
  }
  if (key >= (uint32_t)GC_KEY_ID && key < (uint32_t)GC_KEY_ID + 3u) {
    *value = board->unique_id[key - (uint32_t)GC_KEY_ID];
    return GC_DONE;
  }
  if (key >= (uint32_t)GC_KEY_DISPLACEMENT && key < (uint32_t)GC_KEY_DISPLACEMENT + GC_MOTORS_MOST) {
    const uint32_t index = key - (uint32_t)GC_KEY_DISPLACEMENT;
    const gc_motor *motor = &board->motors[index];
    *value = (uint32_t)gc_motor_counts(motor, &board->parameters, index);
    return motor->rotor.seen ? GC_DONE : GC_NO_MOTOR;
  }
  if (key >= (uint32_t)GC_KEY_ZERO_KNOWN && key < (uint32_t)GC_KEY_ZERO_KNOWN + GC_MOTORS_MOST) {
    *value = board->motors[key - (uint32_t)GC_KEY_ZERO_KNOWN].zero_known ? 1u : 0u;
    return GC_DONE;
  }
  switch (key) {
    case GC_KEY_VERSION:
      *value = GC_FIRMWARE_MAJOR << 16 | GC_FIRMWARE_MINOR << 8 | GC_PARAMETER_VERSION;
      return GC_DONE;
    case GC_KEY_IMAGE:
      *value = board->image_check;
      return GC_DONE;
    case GC_KEY_RESET:
      *value = board->reset_cause;
      return GC_DONE;
    case GC_KEY_UPTIME:
      *value = board->now / 1000000u;
      return GC_DONE;
    case GC_KEY_REJECTED:
      *value = board->rejected;
      return GC_DONE;
    case GC_KEY_SLOWEST:
      *value = board->slowest;
      return GC_DONE;
    case GC_KEY_DROPPED:
      *value = gc_board_lost(board);
      return GC_DONE;
    case GC_KEY_HOMING:
      *value = (uint32_t)board->homing.phase << 8 | board->homing.motor;
      return GC_DONE;
    default:
      return GC_UNKNOWN_KEY;
  }
}

static uint8_t write(gc_board *board, uint32_t key, uint32_t value) {
  if (key >= (uint32_t)GC_PARAMETER_COUNT) {
    return GC_UNKNOWN_KEY;
  }
  if (gc_board_drives(board)) {
    return GC_WRONG_STATE;
  }
  return gc_parameter_set(&board->parameters, key, value) ? GC_DONE : GC_OUT_OF_RANGE;
}

static uint8_t save(gc_board *board, uint32_t value) {
  if (value != GC_SAVE_WORD) {
    return GC_OUT_OF_RANGE;
  }
  // The processor waits while the flash is erased.
  if (gc_board_drives(board)) {
    return GC_WRONG_STATE;
  }
  if (board->storage.erase == NULL || !gc_storage_save(&board->storage, &board->parameters)) {
    return GC_NOT_STORED;
  }
  board->faults &= (uint16_t)~GC_FAULT_PARAMETERS;
  return GC_DONE;
}

// The motor's displacement is `value` counts now.
static uint8_t set_zero(gc_board *board, uint32_t index, uint32_t value) {
  const int32_t counts = (int32_t)value;
  if (!gc_board_has_motor(board, index)) {
    return GC_UNKNOWN_KEY;
  }
  if (counts > 0x10000000 || counts < -0x10000000) {
    return GC_OUT_OF_RANGE;
  }
  gc_motor *motor = &board->motors[index];
  if (!motor->rotor.seen) {
    return GC_NO_MOTOR;
  }
  motor->zero = motor->rotor.count - gc_motor_direction(&board->parameters, index) * counts;
  motor->zero_known = true;
  return GC_DONE;
}

static uint8_t forget_zero(gc_board *board, uint32_t index) {
  if (!gc_board_has_motor(board, index)) {
    return GC_UNKNOWN_KEY;
  }
  board->motors[index].zero_known = false;
  return GC_DONE;
}

static bool all_have_zeros(const gc_board *board) {
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    if (gc_board_has_motor(board, index) && !board->motors[index].zero_known) {
      return false;
    }
  }
  return true;
}

// Whether the board may begin to drive by itself: a fault ends by resume first.
static bool may_begin(const gc_board *board) {
  return board->state != GC_FAULT && !board->supply_low && !board->reserved;
}

static uint8_t home(gc_board *board) {
  if (!may_begin(board) || (gc_board_drives(board) && board->state != GC_STANDALONE)) {
    return GC_WRONG_STATE;
  }
  if (!gc_board_motors_answer(board)) {
    return GC_NO_MOTOR;
  }
  gc_board_home(board);
  return GC_DONE;
}

static uint8_t run(gc_board *board) {
  const bool held = board->state == GC_HOLDING && board->homing.phase == GC_HOMED;
  // On a bus that host and board share, both would send currents to the motors.
  const bool takes_over = board->state == GC_FOLLOWING && gc_board_is_between(board);
  if (gc_board_drives(board) && !held && !takes_over) {
    return GC_WRONG_STATE;
  }
  if (!may_begin(board) || !board->has_controller || !all_have_zeros(board)) {
    return GC_WRONG_STATE;
  }
  if (!gc_board_motors_answer(board)) {
    return GC_NO_MOTOR;
  }
  gc_board_run(board);
  return GC_DONE;
}

static uint8_t act(gc_board *board, uint32_t action) {
  switch (action) {
    case GC_ACT_STOP:
      if (board->state != GC_FAULT) {
        gc_board_enter(board, GC_RELEASED);
      }
      return GC_DONE;
    case GC_ACT_RESUME:
      board->faults &= (uint16_t)~(GC_FAULT_MOTOR | GC_FAULT_HOMING | GC_FAULT_MOTOR_SILENT);
      if (board->state == GC_FAULT) {
        gc_board_enter(board, GC_RELEASED);
      }
      return GC_DONE;
    case GC_ACT_HOME:
      return home(board);
    case GC_ACT_RUN:
      return run(board);
    case GC_ACT_RESTART:
      if (gc_board_drives(board)) {
        return GC_WRONG_STATE;
      }
      board->restart = true;
      return GC_DONE;
    default:
      return GC_UNKNOWN_KEY;
  }
}

static uint8_t perform(gc_board *board, uint8_t operation, uint32_t key, uint32_t *value) {
  switch (operation) {
    case GC_READ:
      return read(board, key, value);
    case GC_WRITE:
      return write(board, key, *value);
    case GC_SAVE:
      return save(board, *value);
    case GC_DEFAULTS:
      if (gc_board_drives(board)) {
        return GC_WRONG_STATE;
      }
      gc_parameters_default(&board->parameters);
      return GC_DONE;
    case GC_ZERO:
      return set_zero(board, key, *value);
    case GC_FORGET:
      return forget_zero(board, key);
    case GC_ACT:
      return act(board, key);
    default:
      return GC_UNKNOWN_OPERATION;
  }
}

void gc_request_take(gc_board *board, const gc_frame *frame) {
  const uint8_t own = (uint8_t)gc_parameter_int(&board->parameters, GC_BOARD_NUMBER);
  if (frame->data[0] != own && frame->data[0] != GC_ANY_BOARD) {
    return;
  }
  const uint8_t operation = frame->data[1];
  uint32_t value = gc_get32(&frame->data[3]);
  const uint8_t result = perform(board, operation, frame->data[2], &value);
  gc_frame reply = gc_frame_of(GC_ID_REPLY, 8u);
  reply.data[0] = (uint8_t)gc_parameter_int(&board->parameters, GC_BOARD_NUMBER);
  reply.data[1] = (uint8_t)((uint8_t)(operation << OPERATION_SHIFT) | result);
  reply.data[2] = frame->data[2];
  gc_put32(&reply.data[3], value);
  gc_frame_seal(&reply);
  gc_queue_put(&board->queues[0], &reply);
}
