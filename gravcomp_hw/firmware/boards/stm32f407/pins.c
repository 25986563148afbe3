#include "pins.h"

#include "registers.h"

enum { OUTPUT = 1, ALTERNATE = 2 };

#define PORT_C 2u
#define EDGE (1u << 5)

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
  RCC->ahb1enr |= RCC_AHB1_GPIOA | RCC_AHB1_GPIOB | RCC_AHB1_GPIOC | RCC_AHB1_GPIOD | RCC_AHB1_GPIOF;
  RCC->apb2enr |= RCC_APB2_SYSCFG;
  gc_pin_select_accelerometer(false);
  gc_pin_select_gyroscope(false);
  mode(GPIOA, 4u, OUTPUT);
  mode(GPIOB, 0u, OUTPUT);
  alternate(GPIOA, 7u, 5u);
  alternate(GPIOB, 3u, 5u);
  alternate(GPIOB, 4u, 5u);
  alternate(GPIOF, 6u, 3u);
  alternate(GPIOD, 0u, 9u);
  alternate(GPIOD, 1u, 9u);
  alternate(GPIOB, 5u, 9u);
  alternate(GPIOB, 6u, 9u);
  SYSCFG->exticr[1] = (SYSCFG->exticr[1] & ~(15u << 4)) | PORT_C << 4;
  EXTI->rtsr |= EDGE;
  EXTI->imr |= EDGE;
}

bool gc_pin_edge(void) {
  const bool came = (EXTI->pr & EDGE) != 0u;
  EXTI->pr = EDGE;
  return came;
}

void gc_pin_select_accelerometer(bool selected) { GPIOA->bsrr = selected ? 1u << (4u + 16u) : 1u << 4u; }

void gc_pin_select_gyroscope(bool selected) { GPIOB->bsrr = selected ? 1u << 16u : 1u; }
