// The board in the memory of a process, for tests and for the virtual robot.
#ifndef GC_HOST_H
#define GC_HOST_H

#include "../../core/board.h"
#include "../../standalone/model_store.h"
#include "loop.h"

// The loop on the board, with its two places for models.
typedef struct {
  gc_standalone standalone;
  gc_model_store store;
  uint32_t models[GC_MODEL_SLOTS][GC_MODEL_SLOT / 4u];
} gc_host_loop;

typedef struct {
  gc_board board;
  gc_parameter_record places[2];
  uint32_t words_left;  // that can still be written before the supply is lost
  gc_host_loop *loop;   // NULL: firmware without the loop on the board
} gc_host;

size_t gc_host_size(void);
size_t gc_host_loop_size(void);

// Let a board that was copied to another place in memory use its own stored places, and the copy of its loop, NULL: it has none.
void gc_host_attach(gc_host *host, gc_host_loop *loop);

// Erase both places for models of a board with a loop, and put a blob of `size` bytes into the first.
void gc_host_put_model(gc_host *host, const uint8_t *blob, size_t size);

// Read the last results of the loop.
void gc_host_loop_read(const gc_host *host, gc_loop_result *result);

// Start as after a reset; the stored places keep what they have.
void gc_host_start(gc_host *host, const uint32_t *unique_id, uint8_t reset_cause);

// Writing to the stored places fails after this number of words.
void gc_host_lose_supply_after(gc_host *host, uint32_t words);

// Set and read a parameter without a request.
bool gc_host_set(gc_host *host, uint32_t key, uint32_t word);
uint32_t gc_host_get(const gc_host *host, uint32_t key);

// Run all ticks up to `now` (us).
void gc_host_advance(gc_host *host, uint32_t now);

void gc_host_receive(gc_host *host, uint32_t bus, const gc_frame *frame);

// counts: three of the accelerometer, three of the gyroscope; time (us) of the data-ready edge.
void gc_host_sample(gc_host *host, const int16_t *counts, int16_t temperature, uint32_t time);

bool gc_host_transmit(gc_host *host, uint32_t bus, gc_frame *frame);
void gc_host_bus_off(gc_host *host, uint32_t bus, bool off);

uint32_t gc_host_duty(const gc_host *host);
uint32_t gc_host_faults(const gc_host *host);

#endif
