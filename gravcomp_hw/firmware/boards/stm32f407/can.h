// One bxCAN controller: 1 Mbit/s, all standard frames into a ring, frames out in the order in which they come.
#ifndef GC_CAN_H
#define GC_CAN_H

#include <stdbool.h>
#include <stdint.h>

#include "../../core/board.h"

#define GC_RING_LENGTH 64u

// Written by the interrupt of reception alone at `head`, read by the tick alone at `tail`.
typedef struct {
  gc_frame frames[GC_RING_LENGTH];
  volatile uint32_t head;
  volatile uint32_t tail;
  volatile uint32_t lost;
} gc_ring;

// Start both controllers; bus 0 is CAN1, bus 1 is CAN2.
void gc_can_start(void);

// Empty the controller's receive FIFO into the ring.
void gc_can_receive(uint32_t bus, gc_ring *ring);

// Take the oldest frame of the ring.
bool gc_ring_take(gc_ring *ring, gc_frame *frame);

// Fill free mailboxes from the board's queue.
void gc_can_send(gc_board *board, uint32_t bus);

bool gc_can_is_off(uint32_t bus);

#endif
