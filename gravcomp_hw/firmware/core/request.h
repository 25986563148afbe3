// Requests of the host: parameters, zero positions, actions; each is answered by a BoardReply.
#ifndef GC_REQUEST_H
#define GC_REQUEST_H

#include "board_state.h"

enum { GC_READ = 1, GC_WRITE, GC_SAVE, GC_DEFAULTS, GC_ZERO, GC_FORGET, GC_ACT };

enum { GC_ACT_STOP = 1, GC_ACT_RESUME, GC_ACT_HOME, GC_ACT_RUN, GC_ACT_RESTART };

enum {
  GC_DONE,
  GC_UNKNOWN_OPERATION,
  GC_UNKNOWN_KEY,
  GC_OUT_OF_RANGE,
  GC_WRONG_STATE,
  GC_NOT_STORED,
  GC_NO_MOTOR,
};

// Keys from here on are read only.
enum {
  GC_KEY_ID = 0x80,  // three words
  GC_KEY_VERSION = 0x83,
  GC_KEY_IMAGE = 0x84,
  GC_KEY_RESET = 0x85,
  GC_KEY_UPTIME = 0x86,
  GC_KEY_REJECTED = 0x87,
  GC_KEY_SLOWEST = 0x88,
  GC_KEY_DROPPED = 0x89,
  GC_KEY_HOMING = 0x8A,
  GC_KEY_DISPLACEMENT = 0x90,  // counts from the zero position, of motor k + 1
  GC_KEY_ZERO_KNOWN = 0x98,
};

#define GC_SAVE_WORD 0x53415645u  // "SAVE": a request that only looks like one does not wear the flash out
#define GC_ANY_BOARD 255u

// Take a whole BoardRequest; the reply waits in the queue of the host's bus.
void gc_request_take(gc_board *board, const gc_frame *frame);

#endif
