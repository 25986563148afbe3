#include "clock.h"

#include "registers.h"

#define PLL_HALF_N 168u  // the PLL runs at 336 MHz from 1 MHz steps

void gc_clock_start(void) {
  RCC->apb1enr |= RCC_APB1_PWR;
  PWR->cr |= PWR_CR_VOS;
  RCC->cr |= RCC_CR_HSEON;
  while ((RCC->cr & RCC_CR_HSERDY) == 0u) {
  }
  FLASH->acr = FLASH_ACR_5_WAITS | FLASH_ACR_PREFETCH | FLASH_ACR_ICACHE | FLASH_ACR_DCACHE;
  RCC->pllcfgr = GC_CRYSTAL_MHZ | (2u * PLL_HALF_N << 6) | RCC_PLLCFGR_HSE | (7u << 24);
  RCC->cfgr = RCC_CFGR_APB1_BY_4 | RCC_CFGR_APB2_BY_2;
  RCC->cr |= RCC_CR_PLLON;
  while ((RCC->cr & RCC_CR_PLLRDY) == 0u) {
  }
  RCC->cfgr = RCC_CFGR_APB1_BY_4 | RCC_CFGR_APB2_BY_2 | RCC_CFGR_SW_PLL;
  while ((RCC->cfgr & RCC_CFGR_SWS) != RCC_CFGR_SWS_PLL) {
  }
}

void gc_clock_count(void) {
  RCC->apb1enr |= RCC_APB1_TIM2;
  TIM2->psc = GC_APB1_TIMER_MHZ - 1u;
  TIM2->arr = 0xFFFFFFFFu;
  TIM2->egr = TIM_EGR_UG;
  TIM2->cr1 = TIM_CR1_CEN;
  SYSTICK_LOAD = GC_CORE_MHZ * 1000u - 1u;
  SYSTICK_VAL = 0u;
  SYSTICK_CTRL = 7u;
}

uint32_t gc_clock_now(void) { return TIM2->cnt; }
