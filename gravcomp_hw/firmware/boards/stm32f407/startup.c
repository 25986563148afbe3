// Table of vectors and the way from reset to main (PM0214 section 2.3.4): fast clock, watchdog, check of the image, memory.
#include <stdbool.h>
#include <stdint.h>

#include "../../core/crc.h"
#include "../../core/memory.h"
#include "clock.h"
#include "handlers.h"
#include "image.h"
#include "registers.h"
#include "watchdog.h"

#define FPU_ACCESS (0xFu << 20)

extern uint8_t gc_stack_top[], gc_boot_end[], gc_code_start[], gc_code_end[];
extern uint8_t gc_data_start[], gc_data_end[], gc_data_source[], gc_bss_start[], gc_bss_end[], gc_ccm_start[], gc_ccm_end[];

typedef void (*gc_vector)(void);

typedef struct {
  uint8_t *stack;
  gc_vector exceptions[15];
  gc_vector interrupts[IRQ_COUNT];
} gc_vectors;

extern const gc_vectors gc_vector_table;

__attribute__((section(".vectors"), used)) const gc_vectors gc_vector_table = {
    .stack = gc_stack_top,
    .exceptions = {gc_reset, gc_stuck, gc_stuck, gc_stuck, gc_stuck, gc_stuck, 0, 0, 0, 0, gc_stuck, gc_stuck, 0, gc_stuck,
                   gc_on_tick},
    .interrupts =
        {
            [IRQ_CAN1_TX] = gc_on_host_sent,
            [IRQ_CAN1_RX0] = gc_on_host_frame,
            [IRQ_EXTI9_5] = gc_on_edge,
            [IRQ_TIM2] = gc_on_data_ready,
            [IRQ_CAN2_TX] = gc_on_motor_sent,
            [IRQ_CAN2_RX0] = gc_on_motor_frame,
        },
};

__attribute__((section(".image_header"), used)) const gc_image_header gc_image = {.magic = GC_IMAGE_MAGIC};

// Faults of the processor, and an image that is not whole: nothing is driven; the watchdog restarts the chip.
__attribute__((noinline)) void gc_stuck(void) {
  for (;;) {
    __asm__ volatile("nop");
  }
}

static uint32_t distance(const uint8_t *from, const uint8_t *to) { return (uint32_t)((uintptr_t)to - (uintptr_t)from); }

static bool image_is_whole(void) {
  const volatile gc_image_header *header = &gc_image;  // its values come after the compiler
  const uint8_t *behind = (const uint8_t *)&gc_image + sizeof gc_image;
  if (header->magic != GC_IMAGE_MAGIC || header->code_size != distance(gc_code_start, gc_code_end) ||
      header->boot_size != distance(behind, gc_boot_end)) {
    return false;
  }
  return gc_crc32(0u, behind, header->boot_size) == header->boot_check &&
         gc_crc32(0u, gc_code_start, header->code_size) == header->code_check;
}

void gc_reset(void) {
  SCB_CPACR |= FPU_ACCESS;
  __asm__ volatile("dsb\n isb");
  gc_watchdog_start();
  gc_clock_start();
  if (!image_is_whole()) {
    gc_stuck();
  }
  gc_watchdog_feed();
  gc_copy(gc_data_start, gc_data_source, distance(gc_data_start, gc_data_end));
  gc_zero(gc_bss_start, distance(gc_bss_start, gc_bss_end));
  gc_zero(gc_ccm_start, distance(gc_ccm_start, gc_ccm_end));
  (void)main();
  gc_stuck();
}
