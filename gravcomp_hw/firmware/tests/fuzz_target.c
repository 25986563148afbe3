// Events are bytes: what happens, then what it needs. What must hold is checked after each event, that of the
// heater after each tick, that of the parameters at the end:
//
//   - no current above the limit, none to a motor that does not exist, none while idle, released or in a fault
//   - no current of a host that has been silent for more than 100 ms
//   - no heating without a command for more than 500 ms unless the board may itself, none above the limit of the duty
//   - each parameter in its range, each frame of the board with a right check byte
#include "fuzz_target.h"

#include "../boards/host/host.h"
#include "../core/crc.h"
#include "../core/memory.h"
#include "../core/request.h"

#define DEAD_HOST 100000u   // us
#define DEAD_HEATER 502000u  // us; with the tick

gc_tally gc_counted;

static gc_host host;
static gc_host_loop loop;  // without a model
static uint32_t host_time;
static uint32_t heater_time;
static bool host_seen;
static bool heater_seen;

static void expect(bool holds) {
  if (!holds) {
    gc_counted.violations++;
#ifdef GC_ABORT
    __builtin_trap();
#endif
  }
}

static void check_currents(const gc_frame *frame, uint32_t first) {
  const gc_board *board = &host.board;
  const gc_state state = board->state;
  const bool may = state == GC_FOLLOWING || state == GC_HOLDING || state == GC_HOMING || state == GC_STANDALONE;
  const bool own = state == GC_HOMING || state == GC_STANDALONE || (state == GC_HOLDING && !board->went_silent);
  const bool alive = host_seen && board->now - host_time <= DEAD_HOST;
  const int32_t limit = gc_parameter_int(&board->parameters, GC_CURRENT_LIMIT);
  for (uint32_t k = 0; k < 4u; k++) {
    const int32_t current = (int16_t)gc_get16(&frame->data[2u * k]);
    const bool present = ((uint32_t)gc_parameter_int(&board->parameters, GC_MOTORS) >> (first + k) & 1u) != 0u;
    expect(current <= limit && current >= -limit);
    expect(current == 0 || (present && may && (own || alive)));
  }
}

static void drain(void) {
  gc_frame frame;
  for (uint32_t bus = 0; bus < GC_BUSES; bus++) {
    while (gc_host_transmit(&host, bus, &frame)) {
      gc_counted.answers++;
      expect(frame.length <= 8u && frame.id < 0x800u);
      if (frame.id == GC_ID_CURRENTS_1_TO_4 || frame.id == GC_ID_CURRENTS_5_TO_8) {
        check_currents(&frame, frame.id == GC_ID_CURRENTS_1_TO_4 ? 0u : 4u);
      } else if (frame.id >= GC_ID_ACCELEROMETER) {
        expect(gc_frame_is_whole(&frame, frame.length));
      } else {
        // Feedback that the board passes on as it came.
      }
    }
  }
}

// The heater is decided at each tick.
static void check_heater(void) {
  const uint32_t duty = gc_host_duty(&host);
  const bool fresh = heater_seen && host.board.now - heater_time <= DEAD_HEATER;
  const bool own = gc_parameter_int(&host.board.parameters, GC_HEATER_OWN) == 1;
  expect(duty == 0u || ((fresh || own) && duty <= (uint32_t)gc_parameter_int(&host.board.parameters, GC_HEATER_LIMIT)));
}

static uint8_t next(const uint8_t **data, size_t *size) {
  if (*size == 0u) {
    return 0u;
  }
  const uint8_t byte = **data;
  (*data)++;
  (*size)--;
  return byte;
}

static void give_frame(const uint8_t **data, size_t *size, uint32_t bus, bool whole) {
  gc_frame frame;
  gc_zero(&frame, sizeof frame);
  const uint32_t high = next(data, size);
  frame.id = (uint16_t)(high << 8 | next(data, size));
  frame.extended = (uint8_t)((high & 0x80u) != 0u ? 1u : 0u);
  frame.id &= 0x7FFu;
  frame.length = next(data, size) & 15u;
  for (uint32_t i = 0; i < 8u; i++) {
    frame.data[i] = next(data, size);
  }
  if (whole && frame.length >= 1u && frame.length <= 8u) {
    gc_frame_seal(&frame);
  }
  const bool read = frame.extended == 0u && bus == 0u;
  if (read && (frame.id == GC_ID_CURRENTS_1_TO_4 || frame.id == GC_ID_CURRENTS_5_TO_8) && frame.length == 8u) {
    host_seen = true;
    host_time = host.board.now;
  }
  if (read && frame.id == GC_ID_HEATER && gc_frame_is_whole(&frame, 4u)) {
    heater_seen = true;
    heater_time = host.board.now;
  }
  gc_counted.frames++;
  gc_host_receive(&host, bus, &frame);
  if (host.board.restart) {
    const uint32_t id[3] = {1u, 2u, 3u};
    gc_host_start(&host, id, GC_RESET_SOFTWARE);
    host_seen = false;
    heater_seen = false;
  }
}

// All motors answer, at rest; these frames are not counted.
static void give_feedback(void) {
  for (uint32_t k = 1; k <= 6u; k++) {
    gc_frame frame = gc_frame_of((uint16_t)(GC_ID_FEEDBACK + k), 8u);
    gc_put16(frame.data, (uint16_t)(100u * k));
    gc_host_receive(&host, gc_board_motor_bus(&host.board), &frame);
  }
}

static void give_sample(const uint8_t **data, size_t *size) {
  int16_t counts[6];
  for (uint32_t i = 0; i < 6u; i++) {
    const uint32_t high = next(data, size);
    counts[i] = (int16_t)(uint16_t)(high << 8 | next(data, size));
  }
  const uint32_t high = next(data, size);
  const int16_t temperature = (int16_t)(uint16_t)(high << 8 | next(data, size));
  gc_counted.samples++;
  gc_host_sample(&host, counts, temperature, host.board.now);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  const uint32_t id[3] = {1u, 2u, 3u};
  gc_zero(&host, sizeof host);
  host.loop = &loop;
  gc_host_lose_supply_after(&host, 0xFFFFFFFFu);
  gc_host_start(&host, id, GC_RESET_POWER);
  host_seen = false;
  heater_seen = false;
  // Motors behind the board; the first byte chooses the wiring.
  (void)gc_host_set(&host, GC_MOTORS, 0x3Fu);
  (void)gc_host_set(&host, GC_WIRING, next(&data, &size) & 1u);
  while (size > 0u) {
    const uint8_t what = next(&data, &size);
    switch (what & 7u) {
      case 0:
      case 1:
        for (uint32_t k = 0; k <= (uint32_t)what >> 3; k++) {
          if ((what & 7u) == 1u) {
            give_feedback();
          }
          gc_host_advance(&host, host.board.now + GC_TICK);
          check_heater();
          drain();
        }
        break;
      case 2:
        give_sample(&data, &size);
        break;
      case 3:
        gc_host_bus_off(&host, (uint32_t)what >> 4 & 1u, (what & 8u) != 0u);
        break;
      case 4:
        gc_host_lose_supply_after(&host, (uint32_t)what >> 3);
        break;
      case 5:
        gc_board_supply(&host.board, (what & 8u) != 0u);
        break;
      default:
        give_frame(&data, &size, (uint32_t)what >> 4 & 1u, (what & 8u) != 0u);
        break;
    }
    drain();
  }
  const gc_parameter_record record = gc_parameter_record_of(&host.board.parameters, 1u);
  expect(gc_parameter_record_is_whole(&record));
  return 0;
}
