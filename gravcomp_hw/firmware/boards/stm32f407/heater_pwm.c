#include "heater_pwm.h"

#include "registers.h"

#define PERIOD 10000u  // counts of 84 MHz / 8: 1 kHz and a count for each 0.0001

void gc_heater_pwm_start(void) {
  RCC->apb1enr |= RCC_APB1_TIM3;
  TIM3->psc = 7u;
  TIM3->arr = PERIOD - 1u;
  TIM3->ccr1 = 0u;
  TIM3->ccmr1 = TIM_CCMR1_PWM | TIM_CCMR1_PRELOAD;
  TIM3->egr = TIM_EGR_UG;
  TIM3->ccer = TIM_CC1_ENABLE;
  TIM3->cr1 = TIM_CR1_CEN;
}

void gc_heater_pwm_set(uint16_t duty) { TIM3->ccr1 = duty; }
