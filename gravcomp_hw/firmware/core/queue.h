// Frames that wait for one bus, oldest first. A full queue drops the new frame and counts it.
#ifndef GC_QUEUE_H
#define GC_QUEUE_H

#include <stdbool.h>
#include <stdint.h>

#include "frame.h"

#define GC_QUEUE_LENGTH 32u

typedef struct {
  gc_frame frames[GC_QUEUE_LENGTH];
  uint32_t first;
  uint32_t count;
  uint32_t dropped;
} gc_queue;

void gc_queue_put(gc_queue *queue, const gc_frame *frame);

// Take the oldest frame; false when none waits.
bool gc_queue_take(gc_queue *queue, gc_frame *frame);

#endif
