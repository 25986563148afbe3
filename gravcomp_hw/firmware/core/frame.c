#include "frame.h"

#include "crc.h"
#include "memory.h"

gc_frame gc_frame_of(uint16_t id, uint8_t length) {
  gc_frame frame;
  gc_zero(&frame, sizeof frame);
  frame.id = id;
  frame.length = length;
  return frame;
}

void gc_put16(uint8_t *to, uint16_t value) {
  to[0] = (uint8_t)(value >> 8);
  to[1] = (uint8_t)value;
}

void gc_put32(uint8_t *to, uint32_t value) {
  gc_put16(to, (uint16_t)(value >> 16));
  gc_put16(to + 2, (uint16_t)value);
}

uint16_t gc_get16(const uint8_t *from) { return (uint16_t)((uint32_t)from[0] << 8 | from[1]); }

uint32_t gc_get32(const uint8_t *from) { return (uint32_t)gc_get16(from) << 16 | gc_get16(from + 2); }

void gc_frame_seal(gc_frame *frame) {
  const uint8_t last = (uint8_t)(frame->length - 1u);
  frame->data[last] = gc_crc8(frame->id, frame->data, last);
}

bool gc_frame_is_whole(const gc_frame *frame, uint8_t length) {
  if (frame->length != length) {
    return false;
  }
  return frame->data[length - 1u] == gc_crc8(frame->id, frame->data, length - 1u);
}
