// Clocks: 168 MHz from a crystal of 12 MHz, a counter of microseconds, the tick of a millisecond.
#ifndef GC_CLOCK_H
#define GC_CLOCK_H

#include <stdint.h>

#ifndef GC_CRYSTAL_MHZ
#define GC_CRYSTAL_MHZ 12u
#endif
#define GC_CORE_MHZ 168u
#define GC_APB1_MHZ 42u
#define GC_APB1_TIMER_MHZ 84u

// Wait for the crystal and run from it; without a crystal the watchdog restarts the chip.
void gc_clock_start(void);

// Start the counter and the interrupt of the tick.
void gc_clock_count(void);

// Microseconds since the start; wraps at 2^32.
uint32_t gc_clock_now(void);

#endif
