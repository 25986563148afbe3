#include "storage.h"

#include <stddef.h>

// Index of the place with the newest whole record, -1 without one.
static int32_t newest(const gc_storage *storage) {
  const bool first = gc_parameter_record_is_whole(storage->places[0]);
  const bool second = gc_parameter_record_is_whole(storage->places[1]);
  if (first && second) {
    // The difference stays right when the sequence wraps.
    return (int32_t)(storage->places[1]->sequence - storage->places[0]->sequence) > 0 ? 1 : 0;
  }
  return first ? 0 : (second ? 1 : -1);
}

bool gc_storage_load(const gc_storage *storage, gc_parameters *parameters) {
  const int32_t place = newest(storage);
  if (place < 0) {
    gc_parameters_default(parameters);
    return false;
  }
  *parameters = storage->places[place]->parameters;
  return true;
}

bool gc_storage_save(const gc_storage *storage, const gc_parameters *parameters) {
  const int32_t old = newest(storage);
  const uint32_t place = old == 0 ? 1u : 0u;
  const uint32_t sequence = old < 0 ? 1u : storage->places[old]->sequence + 1u;
  const gc_parameter_record record = gc_parameter_record_of(parameters, sequence);
  if (!storage->erase(storage->context, place)) {
    return false;
  }
  const uint32_t count = (uint32_t)(sizeof record / sizeof(uint32_t));
  if (!storage->write(storage->context, place, (const uint32_t *)(const void *)&record, count)) {
    return false;
  }
  return gc_parameter_record_is_whole(storage->places[place]) && storage->places[place]->sequence == sequence;
}
