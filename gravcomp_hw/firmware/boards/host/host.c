// The board as a shared library: the caller gives the memory, the time, the frames and the samples.
#include "host.h"

#include "../../core/memory.h"

size_t gc_host_size(void) { return sizeof(gc_host); }

static bool erase(void *context, uint32_t place) {
  gc_host *host = (gc_host *)context;
  if (host->words_left == 0u) {
    return false;
  }
  uint8_t *bytes = (uint8_t *)&host->places[place];
  for (size_t i = 0; i < sizeof host->places[place]; i++) {
    bytes[i] = 0xFFu;
  }
  return true;
}

static bool write(void *context, uint32_t place, const uint32_t *words, uint32_t count) {
  gc_host *host = (gc_host *)context;
  uint8_t *bytes = (uint8_t *)&host->places[place];
  for (uint32_t i = 0; i < count; i++) {
    if (host->words_left == 0u) {
      return false;
    }
    host->words_left--;
    gc_copy(&bytes[4u * i], &words[i], 4u);
  }
  return true;
}

void gc_host_attach(gc_host *host) {
  host->board.storage.places[0] = &host->places[0];
  host->board.storage.places[1] = &host->places[1];
  host->board.storage.erase = erase;
  host->board.storage.write = write;
  host->board.storage.context = host;
}

void gc_host_start(gc_host *host, const uint32_t *unique_id, uint8_t reset_cause) {
  gc_zero(&host->board, sizeof host->board);
  gc_host_attach(host);
  host->board.reset_cause = reset_cause;
  gc_copy(host->board.unique_id, unique_id, sizeof host->board.unique_id);
  gc_board_start(&host->board);
}

void gc_host_lose_supply_after(gc_host *host, uint32_t words) { host->words_left = words; }

bool gc_host_set(gc_host *host, uint32_t key, uint32_t word) {
  return gc_parameter_set(&host->board.parameters, key, word);
}

uint32_t gc_host_get(const gc_host *host, uint32_t key) {
  return key < (uint32_t)GC_PARAMETER_COUNT ? host->board.parameters.words[key] : 0u;
}

void gc_host_advance(gc_host *host, uint32_t now) {
  while (now - host->board.now >= GC_TICK) {
    gc_board_tick(&host->board, host->board.now + GC_TICK);
  }
}

void gc_host_receive(gc_host *host, uint32_t bus, const gc_frame *frame) { gc_board_receive(&host->board, bus, frame); }

void gc_host_sample(gc_host *host, const int16_t *counts, int16_t temperature, uint32_t time) {
  gc_sample sample;
  gc_zero(&sample, sizeof sample);
  gc_copy(sample.force, counts, sizeof sample.force);
  gc_copy(sample.rate, counts + 3, sizeof sample.rate);
  sample.temperature = temperature;
  sample.time = time;
  gc_board_sample(&host->board, &sample);
}

bool gc_host_transmit(gc_host *host, uint32_t bus, gc_frame *frame) {
  return gc_board_transmit(&host->board, bus, frame);
}

void gc_host_bus_off(gc_host *host, uint32_t bus, bool off) { gc_board_bus_off(&host->board, bus, off); }

uint32_t gc_host_duty(const gc_host *host) { return host->board.heater.duty; }

uint32_t gc_host_faults(const gc_host *host) { return gc_board_faults(&host->board); }
