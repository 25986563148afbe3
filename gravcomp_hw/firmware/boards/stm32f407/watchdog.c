#include "watchdog.h"

#include "registers.h"

#define TICKS 320u  // of 8 kHz

void gc_watchdog_start(void) {
  IWDG->kr = IWDG_START;
  IWDG->kr = IWDG_UNLOCK;
  IWDG->pr = 0u;
  IWDG->rlr = TICKS;
  IWDG->kr = IWDG_FEED;
}

void gc_watchdog_feed(void) { IWDG->kr = IWDG_FEED; }
