#include "flash.h"

#include "heater_pwm.h"
#include "registers.h"

#define FIRST_SECTOR 2u

extern const gc_parameter_record gc_parameters_a[], gc_parameters_b[];

// Runs in RAM: the flash cannot be read while it is erased or written. The watchdog is fed meanwhile, for an erasure takes up to
// 0.5 s; no interrupt comes, because their code is in the flash.
__attribute__((section(".in_ram"), noinline)) static void wait(void) {
  do {
    IWDG->kr = IWDG_FEED;
  } while ((FLASH->sr & FLASH_SR_BSY) != 0u);
}

__attribute__((section(".in_ram"), noinline)) static void erase_sector(uint32_t sector) {
  FLASH->cr = FLASH_CR_SER | FLASH_CR_WORDS | sector << FLASH_CR_SECTOR_SHIFT;
  FLASH->cr |= FLASH_CR_STRT;
  wait();
  FLASH->cr = FLASH_CR_WORDS;
}

__attribute__((section(".in_ram"), noinline)) static void write_word(volatile uint32_t *place, uint32_t word) {
  FLASH->cr = FLASH_CR_PG | FLASH_CR_WORDS;
  *place = word;
  wait();
  FLASH->cr = FLASH_CR_WORDS;
}

__attribute__((section(".in_ram"), noinline)) static void write_options(uint32_t options) {
  FLASH->optkeyr = FLASH_OPTION_KEY1;
  FLASH->optkeyr = FLASH_OPTION_KEY2;
  FLASH->optcr = options;
  FLASH->optcr = options | FLASH_OPTCR_START;
  wait();
  FLASH->optcr = options | FLASH_OPTCR_LOCK;
}

void gc_flash_guard_supply(void) {
  const uint32_t options = FLASH->optcr & ~(FLASH_OPTCR_LOCK | FLASH_OPTCR_START);
  if ((options & FLASH_OPTCR_BROWN_OUT) == 0u || (PWR->csr & PWR_CSR_PVDO) != 0u) {
    return;
  }
  __asm__ volatile("cpsid i" ::: "memory");
  write_options(options & ~FLASH_OPTCR_BROWN_OUT);
  __asm__ volatile("cpsie i" ::: "memory");
}

static void unlock(void) {
  __asm__ volatile("cpsid i" ::: "memory");
  if ((FLASH->cr & FLASH_CR_LOCK) != 0u) {
    FLASH->keyr = FLASH_KEY1;
    FLASH->keyr = FLASH_KEY2;
  }
  FLASH->sr = FLASH_SR_ERRORS;
  gc_heater_pwm_set(0u);  // after interrupts are off: for up to two seconds nobody watches it; the next tick sets it again
}

static bool lock(void) {
  FLASH->cr |= FLASH_CR_LOCK;
  // What the cache has is older than what was written (RM0090 section 3.5.3).
  FLASH->acr &= ~FLASH_ACR_DCACHE;
  FLASH->acr |= 1u << 12;
  FLASH->acr &= ~(1u << 12);
  FLASH->acr |= FLASH_ACR_DCACHE;
  const bool good = (FLASH->sr & FLASH_SR_ERRORS) == 0u;
  __asm__ volatile("cpsie i" ::: "memory");
  return good;
}

static bool erase_parameters(void *context, uint32_t place) {
  (void)context;
  unlock();
  erase_sector(FIRST_SECTOR + place);
  return lock();
}

static bool write_parameters(void *context, uint32_t place, const uint32_t *words, uint32_t count) {
  (void)context;
  volatile uint32_t *to = (volatile uint32_t *)(uintptr_t)(place == 0u ? gc_parameters_a : gc_parameters_b);
  unlock();
  for (uint32_t i = 0; i < count; i++) {
    write_word(&to[i], words[i]);
  }
  return lock();
}

gc_storage gc_flash_storage(void) {
  const gc_storage storage = {
      .places = {gc_parameters_a, gc_parameters_b},
      .erase = erase_parameters,
      .write = write_parameters,
  };
  return storage;
}

#ifdef GC_WITH_STANDALONE
#define FIRST_MODEL_SECTOR 6u
#define MODEL_SECTORS (GC_MODEL_SLOT / GC_MODEL_SECTOR)

extern const uint8_t gc_model_a[], gc_model_b[];

static bool erase_model(void *context, uint32_t slot, uint32_t sector) {
  (void)context;
  unlock();
  erase_sector(FIRST_MODEL_SECTOR + MODEL_SECTORS * slot + sector);
  return lock();
}

static bool write_model(void *context, uint32_t slot, uint32_t offset, uint32_t word) {
  (void)context;
  volatile uint32_t *to = (volatile uint32_t *)((uintptr_t)(slot == 0u ? gc_model_a : gc_model_b) + offset);
  unlock();
  write_word(to, word);
  return lock() && *to == word;
}

gc_model_memory gc_flash_models(void) {
  const gc_model_memory memory = {
      .slots = {gc_model_a, gc_model_b},
      .erase = erase_model,
      .write = write_model,
  };
  return memory;
}
#endif
