// The independent watchdog, with a clock of its own: nominally 40 ms, 27 to 75 ms over the tolerance of that clock.
#ifndef GC_WATCHDOG_H
#define GC_WATCHDOG_H

void gc_watchdog_start(void);
void gc_watchdog_feed(void);

#endif
