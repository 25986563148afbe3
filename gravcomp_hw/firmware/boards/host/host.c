// The board as a shared library: the caller gives the memory, the time, the frames and the samples.
#include "host.h"

#include "../../core/memory.h"

size_t gc_host_size(void) { return sizeof(gc_host); }

size_t gc_host_loop_size(void) { return sizeof(gc_host_loop); }

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

static bool erase_model(void *context, uint32_t slot, uint32_t sector) {
  gc_host *host = (gc_host *)context;
  if (host->words_left == 0u) {
    return false;
  }
  for (uint32_t i = 0; i < GC_MODEL_SECTOR / 4u; i++) {
    host->loop->models[slot][sector * (GC_MODEL_SECTOR / 4u) + i] = 0xFFFFFFFFu;
  }
  return true;
}

static bool write_model(void *context, uint32_t slot, uint32_t offset, uint32_t word) {
  gc_host *host = (gc_host *)context;
  if (host->words_left == 0u) {
    return false;
  }
  host->words_left--;
  host->loop->models[slot][offset / 4u] &= word;
  return host->loop->models[slot][offset / 4u] == word;
}

static void attach_loop(gc_host *host) {
  gc_model_store *store = &host->loop->store;
  store->memory.slots[0] = (const uint8_t *)host->loop->models[0];
  store->memory.slots[1] = (const uint8_t *)host->loop->models[1];
  store->memory.erase = erase_model;
  store->memory.write = write_model;
  store->memory.context = host;
  store->loop = &host->loop->standalone;
  host->board.receiver = gc_model_store_receive;
  host->board.receiver_context = store;
}

void gc_host_attach(gc_host *host, gc_host_loop *loop) {
  host->board.storage.places[0] = &host->places[0];
  host->board.storage.places[1] = &host->places[1];
  host->board.storage.erase = erase;
  host->board.storage.write = write;
  host->board.storage.context = host;
  host->loop = loop;
  if (loop == NULL) {
    return;
  }
  attach_loop(host);
  gc_model model;
  const uint32_t used = loop->store.used;
  if (used < GC_MODEL_SLOTS && loop->standalone.loaded) {
    const uint8_t *blob = loop->store.memory.slots[used];
    if (gc_model_open(&model, blob, gc_model_length(blob, GC_MODEL_SLOT), GC_MODEL_MAGIC, NULL, NULL) == GC_MODEL_OK) {
      gc_standalone_moved(&loop->standalone, &model);
    }
  }
}

void gc_host_put_model(gc_host *host, const uint8_t *blob, size_t size) {
  uint8_t *bytes = (uint8_t *)host->loop->models;
  const size_t room = GC_MODEL_SLOTS * GC_MODEL_SLOT;
  for (size_t i = 0; i < room; i++) {
    bytes[i] = i < size ? blob[i] : 0xFFu;
  }
}

void gc_host_loop_read(const gc_host *host, gc_loop_result *result) { gc_loop_read(&host->loop->standalone, result); }

static void note_model(gc_host *host) {
  const bool loaded = host->loop->standalone.loaded;
  const uint32_t others = (uint32_t)host->board.faults & ~(uint32_t)GC_FAULT_MODEL;
  host->board.has_controller = loaded;
  host->board.faults = (uint16_t)(others | (loaded ? 0u : (uint32_t)GC_FAULT_MODEL));
}

void gc_host_start(gc_host *host, const uint32_t *unique_id, uint8_t reset_cause) {
  gc_host_loop *loop = host->loop;
  gc_zero(&host->board, sizeof host->board);
  gc_host_attach(host, NULL);
  host->loop = loop;
  host->board.reset_cause = reset_cause;
  gc_copy(host->board.unique_id, unique_id, sizeof host->board.unique_id);
  if (host->loop != NULL) {
    gc_zero(&host->loop->standalone, sizeof host->loop->standalone);
    gc_zero(&host->loop->store, sizeof host->loop->store);
    attach_loop(host);
    (void)gc_model_store_start(&host->loop->store);
    note_model(host);
  }
  gc_board_start(&host->board);
}

// Work on the frames of a new model, as main does on the chip.
static void renew(gc_host *host) {
  while (host->loop != NULL && gc_model_store_waits(&host->loop->store)) {
    gc_frame reply;
    const bool answers = gc_model_store_work(&host->loop->store, gc_board_reserve(&host->board), &reply);
    gc_board_unreserve(&host->board);
    note_model(host);
    if (answers) {
      gc_queue_put(&host->board.queues[0], &reply);
    }
  }
}

// Work on the sample that waits.
static void work(gc_host *host) {
  gc_sample sample;
  float displacement[GC_MOTORS_MOST] = {0.0f}, tension[GC_MOTORS_MOST] = {0.0f};
  if (!gc_board_job(&host->board, &sample) || host->loop == NULL) {
    return;
  }
  if (gc_standalone_step(&host->loop->standalone, &sample, gc_board_motors(&host->board), displacement, tension)) {
    gc_board_targets(&host->board, displacement, tension);
  }
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
    work(host);
    renew(host);
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
  work(host);
}

bool gc_host_transmit(gc_host *host, uint32_t bus, gc_frame *frame) {
  return gc_board_transmit(&host->board, bus, frame);
}

void gc_host_bus_off(gc_host *host, uint32_t bus, bool off) { gc_board_bus_off(&host->board, bus, off); }

uint32_t gc_host_duty(const gc_host *host) { return host->board.heater.duty; }

uint32_t gc_host_faults(const gc_host *host) { return gc_board_faults(&host->board); }
