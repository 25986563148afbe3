// Two places for models in the flash, the loop that uses one of them, and the frames of a host that writes the other.
//
// The loop goes on with its model until the new one is whole and taken. The first word of a blob, its magic, is written when all
// else has been checked, so that a model of which the supply has failed is none. Interrupts only queue the frames; the work is
// done below them.
#ifndef GC_MODEL_STORE_H
#define GC_MODEL_STORE_H

#include "standalone.h"

#define GC_ID_MODEL_REQUEST 0x329u  // operation, sector uint8; size uint32; 0; check
#define GC_ID_MODEL_DATA 0x32Au     // sequence uint8; seven bytes of the blob
#define GC_ID_MODEL_REPLY 0x319u    // operation, result, model status uint8; bytes taken uint32; check

#define GC_MODEL_SLOTS 2u
#define GC_MODEL_SLOT 0x60000u    // bytes of a place
#define GC_MODEL_SECTOR 0x20000u  // bytes that are erased at once
#define GC_MODEL_BYTES 7u         // of a frame of data
#define GC_MODEL_WINDOW 32u       // frames of data that are answered together
#define GC_STORE_FRAMES 64u

enum {
  GC_MODEL_DATA,     // in answers only
  GC_MODEL_BEGIN,    // size: of the blob
  GC_MODEL_ERASE,    // sector of the place, in order
  GC_MODEL_END,      // check the blob and use it
  GC_MODEL_WHERE,    // how many bytes are taken
  GC_MODEL_FORGET    // size: GC_FORGET_WORD; leaves the board without a model, so that one of another robot can come
};

enum {
  GC_STORE_DONE,
  GC_STORE_UNKNOWN,      // operation
  GC_STORE_NOT_BEGUN,    // or sectors are not erased
  GC_STORE_TOO_BIG,
  GC_STORE_WRONG_STATE,  // the board drives motors
  GC_STORE_NOT_STORED,
  GC_STORE_REFUSED,      // the model status says why
  GC_STORE_LOST          // a frame is missing: the host continues from the bytes that are taken
};

#define GC_FORGET_WORD 0x464F5247u  // "FORG"

// What a board provides: both places as readable memory, and the means to erase a sector and to write a word at an offset.
typedef struct {
  const uint8_t *slots[GC_MODEL_SLOTS];
  bool (*erase)(void *context, uint32_t slot, uint32_t sector);
  bool (*write)(void *context, uint32_t slot, uint32_t offset, uint32_t word);
  gc_alive *alive;
  void *context;
} gc_model_memory;

typedef struct {
  gc_model_memory memory;
  gc_standalone *loop;
  uint32_t used;   // place of the loop's model; GC_MODEL_SLOTS: none
  bool begun;
  uint32_t slot;   // place that is written
  uint32_t size;   // bytes of the new blob
  uint32_t taken;
  uint32_t erased;  // sectors
  uint32_t magic;   // first word of the new blob
  bool said_lost;   // of the frames that are missing
  uint8_t pending[4];
  gc_frame frames[GC_STORE_FRAMES];  // written by interrupts at `head`, read below them at `tail`
  volatile uint32_t head;
  volatile uint32_t tail;
} gc_model_store;

// Load the first whole model. The caller has set memory and loop; the rest is zero. Returns whether there is one.
bool gc_model_store_start(gc_model_store *store);

// Take a frame of the host, for the loop or for the store. A gc_receiver, of a gc_model_store.
bool gc_model_store_receive(void *context, const gc_frame *frame, gc_frame *reply);

// Whether a frame waits for gc_model_store_work.
bool gc_model_store_waits(const gc_model_store *store);

// Work on one frame, below the interrupts. may_write: the flash may be written now. Returns true with the reply to send.
bool gc_model_store_work(gc_model_store *store, bool may_write, gc_frame *reply);

#endif
