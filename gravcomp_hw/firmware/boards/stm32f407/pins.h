// The pins. Another board with this chip changes this page.
//
//   PA0   data ready of the gyroscope (BMI088 INT3), TIM2 channel 1
//   PA4   chip select of the accelerometer        PB0   chip select of the gyroscope
//   PA5, PA6, PA7   SPI1 clock, input, output
//   PB4   heater, TIM3 channel 1; a resistor to ground keeps it off while the chip is in reset
//   PB8, PB9        CAN1, host                    PB12, PB13   CAN2, motors
#ifndef GC_PINS_H
#define GC_PINS_H

#include <stdbool.h>

void gc_pins_start(void);
void gc_pin_select_accelerometer(bool selected);
void gc_pin_select_gyroscope(bool selected);

#endif
