#include "pins.h"

#include "registers.h"

enum { OUTPUT = 1, ALTERNATE = 2 };

static void mode(gc_gpio *port, uint32_t pin, uint32_t value) {
  port->moder = (port->moder & ~(3u << 2u * pin)) | value << 2u * pin;
  port->ospeedr |= 2u << 2u * pin;
}

static void alternate(gc_gpio *port, uint32_t pin, uint32_t function) {
  gc_register *half = pin < 8u ? &port->afrl : &port->afrh;
  const uint32_t shift = 4u * (pin % 8u);
  *half = (*half & ~(15u << shift)) | function << shift;
  mode(port, pin, ALTERNATE);
}

void gc_pins_start(void) {
  RCC->ahb1enr |= RCC_AHB1_GPIOA | RCC_AHB1_GPIOB;
  gc_pin_select_accelerometer(false);
  gc_pin_select_gyroscope(false);
  mode(GPIOA, 4u, OUTPUT);
  mode(GPIOB, 0u, OUTPUT);
  alternate(GPIOA, 0u, 1u);
  alternate(GPIOA, 5u, 5u);
  alternate(GPIOA, 6u, 5u);
  alternate(GPIOA, 7u, 5u);
  alternate(GPIOB, 4u, 2u);
  alternate(GPIOB, 8u, 9u);
  alternate(GPIOB, 9u, 9u);
  alternate(GPIOB, 12u, 9u);
  alternate(GPIOB, 13u, 9u);
}

void gc_pin_select_accelerometer(bool selected) { GPIOA->bsrr = selected ? 1u << (4u + 16u) : 1u << 4u; }

void gc_pin_select_gyroscope(bool selected) { GPIOB->bsrr = selected ? 1u << 16u : 1u; }
