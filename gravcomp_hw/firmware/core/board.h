// The board between its inputs and outputs. It has no hardware of its own: boards/ gives it frames, samples and time, and takes
// frames and the heater's duty.
#ifndef GC_BOARD_H
#define GC_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "board_state.h"

#define GC_TICK 1000u  // us between two calls of gc_board_tick

// Begin with the stored parameters. The caller has set storage, unique_id, image_check, reset_cause, has_controller and
// receiver; the rest of the memory is zero. Where `storage.erase` is NULL the defaults count.
void gc_board_start(gc_board *board);

// Advance to `now` (us); called each GC_TICK.
void gc_board_tick(gc_board *board, uint32_t now);

// Take a frame that a bus has received.
void gc_board_receive(gc_board *board, uint32_t bus, const gc_frame *frame);

// Take a sample of the IMU: counts, temperature and stamp are set.
void gc_board_sample(gc_board *board, const gc_sample *sample);

// Give the sample that the loop on the board has to work on, below the interrupts; false when there is none.
bool gc_board_job(gc_board *board, gc_sample *sample);

// Take the result for eight motors: targets (m) and expected tensions (N).
void gc_board_targets(gc_board *board, const float *displacement, const float *tension);

// Take note that the supply is too low, or enough again: no current and no heater meanwhile.
void gc_board_supply(gc_board *board, bool low);

// Take note that a bus is off, or on again.
void gc_board_bus_off(gc_board *board, uint32_t bus, bool off);

// Take the next frame to send on a bus; false when none waits.
bool gc_board_transmit(gc_board *board, uint32_t bus, gc_frame *frame);

// All lasting and present faults.
uint16_t gc_board_faults(const gc_board *board);

#endif
