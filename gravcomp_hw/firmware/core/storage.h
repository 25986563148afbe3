// Two places for the parameters in memory that keeps them without supply. The one is whole while the other is written.
#ifndef GC_STORAGE_H
#define GC_STORAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"

// What a board provides: each place as readable memory, and the means to erase it and to write at its start.
typedef struct {
  const gc_parameter_record *places[2];
  bool (*erase)(void *context, uint32_t place);
  bool (*write)(void *context, uint32_t place, const uint32_t *words, uint32_t count);
  void *context;
} gc_storage;

// Read the newest whole record. False, and defaults, when neither place has one.
bool gc_storage_load(const gc_storage *storage, gc_parameters *parameters);

// Write into the place that does not have the newest whole record; false when it cannot be read back.
bool gc_storage_save(const gc_storage *storage, const gc_parameters *parameters);

#endif
