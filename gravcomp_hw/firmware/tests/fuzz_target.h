// The board under hostile frames: what must hold whatever comes.
#ifndef GC_FUZZ_TARGET_H
#define GC_FUZZ_TARGET_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
  uint64_t frames;      // given to the board
  uint64_t samples;     // given to the board
  uint64_t answers;     // frames that came back
  uint64_t violations;  // of what must hold
} gc_tally;

extern gc_tally gc_counted;

// Give the board the events in `data`. The name is that of libFuzzer, which can run it, too.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#endif
