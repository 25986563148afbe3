#include "heater_pwm.h"

#include "registers.h"

#define PERIOD 10000u  // counts of 168 MHz / 16: 1 kHz and a count for each 0.0001

void gc_heater_pwm_start(void) {
  RCC->apb2enr |= RCC_APB2_TIM10;
  TIM10->psc = 15u;
  TIM10->arr = PERIOD - 1u;
  TIM10->ccr1 = 0u;
  TIM10->ccmr1 = TIM_CCMR1_PWM | TIM_CCMR1_PRELOAD;
  TIM10->egr = TIM_EGR_UG;
  TIM10->ccer = TIM_CC1_ENABLE;
  TIM10->cr1 = TIM_CR1_CEN;
}

void gc_heater_pwm_set(uint16_t duty) { TIM10->ccr1 = duty; }
