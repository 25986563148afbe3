// What the firmware writes into the flash: the parameters in sectors 2 and 3, the models of the loop on the board in 6 to 11.
#ifndef GC_FLASH_H
#define GC_FLASH_H

#include "../../core/storage.h"

gc_storage gc_flash_storage(void);

// Let the chip's brown-out reset act below 2.7 to 2.9 V (RM0090 section 3.6): shipped chips have it off. It is written once, where the
// supply is good, and acts from the next power-on.
void gc_flash_guard_supply(void);

#ifdef GC_WITH_STANDALONE
#include "../../standalone/model_store.h"

// The caller sets what is called while a model is checked.
gc_model_memory gc_flash_models(void);
#endif

#endif
