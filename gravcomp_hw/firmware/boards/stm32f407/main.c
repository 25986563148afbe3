// The board on the STM32F407. Interrupts of reception fill rings, that of the data-ready edge takes its time. All others have one
// priority and therefore never interrupt each other: the tick, the sample and the mailboxes share the board without locks. The loop on the board runs below them.
#include <stdint.h>

#include "../../core/board.h"
#include "bmi088.h"
#include "can.h"
#include "clock.h"
#include "flash.h"
#include "handlers.h"
#include "heater_pwm.h"
#include "image.h"
#include "pins.h"
#include "registers.h"
#include "watchdog.h"

#ifdef GC_WITH_STANDALONE
#include "../../standalone/model_store.h"
#endif

#define RECEPTION_PRIORITY 0x10u  // and of the edge
#define COMMON_PRIORITY 0x80u
#define PATIENCE 40u  // ticks without a turn of main's loop after which the watchdog is not fed

static gc_board board;
static gc_bmi088 imu;
static gc_ring rings[GC_BUSES];
static volatile uint32_t edge;   // us, of the last data-ready edge
static volatile uint32_t turns;  // of the loop in main
static uint32_t turns_seen;
static uint32_t ticks_without_turn;

#ifdef GC_WITH_STANDALONE
static gc_standalone standalone;
__attribute__((section(".ccm"))) static gc_model_store store;
#endif

static void enable(uint32_t number, uint8_t priority) {
  NVIC_IPR[number] = priority;
  NVIC_ISER[number / 32u] = 1u << number % 32u;
}

static uint8_t reset_cause(void) {
  const uint32_t flags = RCC->csr;
  RCC->csr |= RCC_CSR_RMVF;
  if ((flags & RCC_CSR_IWDGRSTF) != 0u) {
    return GC_RESET_WATCHDOG;
  }
  if ((flags & RCC_CSR_SFTRSTF) != 0u) {
    return GC_RESET_SOFTWARE;
  }
  if ((flags & RCC_CSR_PORRSTF) != 0u) {
    return GC_RESET_POWER;
  }
  if ((flags & RCC_CSR_BORRSTF) != 0u) {
    return GC_RESET_SUPPLY;
  }
  return GC_RESET_PIN;
}

static void send_all(void) {
  for (uint32_t bus = 0; bus < GC_BUSES; bus++) {
    gc_can_send(&board, bus);
  }
}

void gc_on_tick(void) {
  const uint32_t now = gc_clock_now();
  for (uint32_t bus = 0; bus < GC_BUSES; bus++) {
    gc_frame frame;
    while (gc_ring_take(&rings[bus], &frame)) {
      gc_board_receive(&board, bus, &frame);
    }
    gc_board_bus_off(&board, bus, gc_can_is_off(bus));
  }
  board.lost = rings[0].lost + rings[1].lost;
  gc_board_supply(&board, (PWR->csr & PWR_CSR_PVDO) != 0u);
  gc_bmi088_tick(&imu, &board.parameters, now);
  gc_board_tick(&board, now);
  gc_heater_pwm_set(board.heater.duty);
  send_all();
  if (board.restart) {
    SCB_AIRCR = SCB_AIRCR_RESET;
  }
  const uint32_t taken = gc_clock_now() - now;
  board.slowest = taken > board.slowest ? taken : board.slowest;
  ticks_without_turn = turns == turns_seen ? ticks_without_turn + 1u : 0u;
  turns_seen = turns;
  if (ticks_without_turn < PATIENCE) {
    gc_watchdog_feed();
  }
}

// The stamp is taken at once; the sample is read at the common priority, by the interrupt of a timer that has none of its own.
void gc_on_edge(void) {
  if (gc_pin_edge()) {
    edge = gc_clock_now();
    NVIC_ISPR[IRQ_TIM2 / 32u] = 1u << IRQ_TIM2 % 32u;
  }
}

void gc_on_data_ready(void) {
  gc_sample sample;
  if (gc_bmi088_read(&imu, edge, &sample)) {
    gc_board_sample(&board, &sample);
    send_all();
  }
}

void gc_on_host_frame(void) { gc_can_receive(0u, &rings[0]); }

void gc_on_motor_frame(void) { gc_can_receive(1u, &rings[1]); }

void gc_on_host_sent(void) { gc_can_send(&board, 0u); }

void gc_on_motor_sent(void) { gc_can_send(&board, 1u); }

#ifdef GC_WITH_STANDALONE
static void alive(void) {
  turns++;
  gc_watchdog_feed();
}

static void note_model(void) {
  board.has_controller = standalone.loaded;
  board.faults = (uint16_t)(standalone.loaded ? board.faults & ~(uint32_t)GC_FAULT_MODEL : board.faults | (uint32_t)GC_FAULT_MODEL);
}

static void start_standalone(void) {
  store.memory = gc_flash_models();
  store.memory.alive = alive;
  store.loop = &standalone;
  (void)gc_model_store_start(&store);
  board.receiver = gc_model_store_receive;
  board.receiver_context = &store;
  note_model();
}

// Work on the frames of a new model.
static void renew(void) {
  while (gc_model_store_waits(&store)) {
    gc_frame reply;
    __asm__ volatile("cpsid i" ::: "memory");
    const bool may_write = gc_board_reserve(&board);
    __asm__ volatile("cpsie i" ::: "memory");
    const bool answers = gc_model_store_work(&store, may_write, &reply);
    __asm__ volatile("cpsid i" ::: "memory");
    gc_board_unreserve(&board);
    note_model();
    if (answers) {
      gc_queue_put(&board.queues[0], &reply);
      gc_can_send(&board, 0u);
    }
    __asm__ volatile("cpsie i" ::: "memory");
    turns++;
  }
}

static void work(void) {
  gc_sample sample;
  float displacement[GC_MOTORS_MOST] = {0.0f};
  float tension[GC_MOTORS_MOST] = {0.0f};
  __asm__ volatile("cpsid i" ::: "memory");
  const bool due = gc_board_job(&board, &sample);
  __asm__ volatile("cpsie i" ::: "memory");
  if (!due) {
    return;
  }
  const uint8_t motors = (uint8_t)gc_parameter_int(&board.parameters, GC_MOTORS);
  if (gc_standalone_step(&standalone, &sample, motors, displacement, tension)) {
    __asm__ volatile("cpsid i" ::: "memory");
    gc_board_targets(&board, displacement, tension);
    __asm__ volatile("cpsie i" ::: "memory");
  }
}
#endif

int main(void) {
  board.reset_cause = reset_cause();
  board.image_check = gc_image.code_check;
  board.storage = gc_flash_storage();
  for (uint32_t i = 0; i < 3u; i++) {
    board.unique_id[i] = UNIQUE_ID[i];
  }
  PWR->cr |= PWR_CR_PVD_2V9 | PWR_CR_PVDE;
  gc_flash_guard_supply();
  gc_pins_start();
  gc_heater_pwm_start();
  gc_bmi088_start(&imu);
  gc_can_start();
#ifdef GC_WITH_STANDALONE
  start_standalone();
#endif
  gc_board_start(&board);
  SCB_SHPR[11] = COMMON_PRIORITY;  // SysTick
  enable(IRQ_TIM2, COMMON_PRIORITY);
  enable(IRQ_EXTI9_5, RECEPTION_PRIORITY);
  enable(IRQ_CAN1_TX, COMMON_PRIORITY);
  enable(IRQ_CAN2_TX, COMMON_PRIORITY);
  enable(IRQ_CAN1_RX0, RECEPTION_PRIORITY);
  enable(IRQ_CAN2_RX0, RECEPTION_PRIORITY);
  gc_clock_count();
  for (;;) {
    turns++;
#ifdef GC_WITH_STANDALONE
    work();
    renew();
#endif
    __asm__ volatile("wfi");
  }
}
