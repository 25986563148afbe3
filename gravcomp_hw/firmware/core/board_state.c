#include "board_state.h"

uint8_t gc_board_motors(const gc_board *board) {
  return (uint8_t)gc_parameter_int(&board->parameters, GC_MOTORS);
}

bool gc_board_has_motor(const gc_board *board, uint32_t index) {
  return index < GC_MOTORS_MOST && ((uint32_t)gc_board_motors(board) >> index & 1u) != 0u;
}

bool gc_board_motors_answer(const gc_board *board) {
  bool all = gc_board_motors(board) != 0u;
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    all = all && (!gc_board_has_motor(board, index) || gc_rotor_answers(&board->motors[index].rotor, board->now));
  }
  return all;
}

bool gc_board_is_between(const gc_board *board) { return gc_parameter_int(&board->parameters, GC_WIRING) == 1; }

uint32_t gc_board_motor_bus(const gc_board *board) { return gc_board_is_between(board) ? 1u : 0u; }

bool gc_board_drives(const gc_board *board) {
  return board->state != GC_IDLE && board->state != GC_RELEASED && board->state != GC_FAULT;
}

uint32_t gc_board_lost(const gc_board *board) {
  return board->queues[0].dropped + board->queues[1].dropped + board->lost;
}

bool gc_board_reserve(gc_board *board) {
  board->reserved = !gc_board_drives(board);
  return board->reserved;
}

void gc_board_unreserve(gc_board *board) { board->reserved = false; }

void gc_board_enter(gc_board *board, gc_state state) {
  board->state = state;
  board->state_since = board->now;
  board->pending = false;
  if (state == GC_RELEASED || state == GC_FAULT) {
    board->sent = board->now - GC_ZERO_PERIOD;  // zeros with the next tick
    for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
      board->motors[index].wanted = 0;
    }
  }
}

void gc_board_home(gc_board *board) {
  gc_homing_start(&board->homing, board->motors, &board->parameters, gc_board_motors(board));
  board->next_drive = board->now;
  gc_board_enter(board, GC_HOMING);
}

void gc_board_hold_in(gc_board *board, gc_state state) {
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    gc_motor_hold(&board->motors[index], &board->parameters, index);
  }
  board->next_drive = board->now;
  gc_board_enter(board, state);
}

void gc_board_run(gc_board *board) { gc_board_hold_in(board, GC_STANDALONE); }
