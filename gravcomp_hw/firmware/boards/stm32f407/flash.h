// The two places of the parameters in sectors 2 and 3 of the flash.
#ifndef GC_FLASH_H
#define GC_FLASH_H

#include "../../core/storage.h"

gc_storage gc_flash_storage(void);

#endif
