#include "queue.h"

void gc_queue_put(gc_queue *queue, const gc_frame *frame) {
  if (queue->count >= GC_QUEUE_LENGTH) {
    queue->dropped++;
    return;
  }
  queue->frames[(queue->first + queue->count) % GC_QUEUE_LENGTH] = *frame;
  queue->count++;
}

bool gc_queue_take(gc_queue *queue, gc_frame *frame) {
  if (queue->count == 0u) {
    return false;
  }
  *frame = queue->frames[queue->first];
  queue->first = (queue->first + 1u) % GC_QUEUE_LENGTH;
  queue->count--;
  return true;
}
