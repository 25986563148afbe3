// Copying and clearing of memory without a C library.
#ifndef GC_MEMORY_H
#define GC_MEMORY_H

#include <stddef.h>
#include <stdint.h>

// Copy `size` bytes; the two places do not overlap.
static inline void gc_copy(void *to, const void *from, size_t size) {
  uint8_t *target = (uint8_t *)to;
  const uint8_t *source = (const uint8_t *)from;
  for (size_t i = 0; i < size; i++) {
    target[i] = source[i];
  }
}

// Set `size` bytes to zero.
static inline void gc_zero(void *memory, size_t size) {
  uint8_t *target = (uint8_t *)memory;
  for (size_t i = 0; i < size; i++) {
    target[i] = 0;
  }
}

#endif
