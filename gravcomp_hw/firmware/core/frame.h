// CAN frames (FRAMES.md): standard data frames, numbers big-endian, most with a check byte.
#ifndef GC_FRAME_H
#define GC_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#define GC_PROTOCOL 1u

enum {
  GC_ID_CURRENTS_5_TO_8 = 0x1FF,
  GC_ID_CURRENTS_1_TO_4 = 0x200,
  GC_ID_FEEDBACK = 0x200,  // plus the number of the motor, 1 to 8
  GC_ID_ACCELEROMETER = 0x310,
  GC_ID_GYROSCOPE = 0x311,
  GC_ID_TIME = 0x312,
  GC_ID_STATUS = 0x313,
  GC_ID_REPLY = 0x314,
  GC_ID_STATE = 0x315,
  GC_ID_BOARD_LAST = 0x31F,  // 0x310 to 0x31F are sent by boards only
  GC_ID_HEATER = 0x320,
  GC_ID_REQUEST = 0x322,
  GC_ID_MODEL_FIRST = 0x328,  // frames to the loop on the board
  GC_ID_MODEL_LAST = 0x32F
};

// One frame; `extended` marks everything that is not a standard data frame, which the board ignores.
typedef struct {
  uint16_t id;
  uint8_t length;
  uint8_t extended;
  uint8_t data[8];
} gc_frame;

// Start a frame of `length` zero bytes.
gc_frame gc_frame_of(uint16_t id, uint8_t length);

void gc_put16(uint8_t *to, uint16_t value);
void gc_put32(uint8_t *to, uint32_t value);
uint16_t gc_get16(const uint8_t *from);
uint32_t gc_get32(const uint8_t *from);

// Set the last byte to the check of those before it.
void gc_frame_seal(gc_frame *frame);

// Whether the frame has this length and a right check byte.
bool gc_frame_is_whole(const gc_frame *frame, uint8_t length);

#endif
