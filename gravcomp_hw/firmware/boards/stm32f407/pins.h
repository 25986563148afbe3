// The pins of the RoboMaster Development Board C. Another board with this chip changes this page, pins.c and the crystal in clock.h.
//
//   PC5   data ready of the gyroscope (BMI088 INT3)
//   PA4   chip select of the accelerometer        PB0   chip select of the gyroscope
//   PB3, PB4, PA7   SPI1 clock, input, output
//   PF6   heater, TIM10 channel 1
//   PD0, PD1        CAN1, host                    PB5, PB6   CAN2, motors
#ifndef GC_PINS_H
#define GC_PINS_H

#include <stdbool.h>

void gc_pins_start(void);

// Whether the data-ready edge has come since the last call.
bool gc_pin_edge(void);

void gc_pin_select_accelerometer(bool selected);
void gc_pin_select_gyroscope(bool selected);

#endif
