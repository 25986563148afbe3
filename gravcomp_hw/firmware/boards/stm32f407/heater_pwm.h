// PWM of the heater.
#ifndef GC_HEATER_PWM_H
#define GC_HEATER_PWM_H

#include <stdint.h>

void gc_heater_pwm_start(void);

// duty in 0.0001.
void gc_heater_pwm_set(uint16_t duty);

#endif
