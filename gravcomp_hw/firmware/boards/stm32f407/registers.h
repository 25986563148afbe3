// The registers of the STM32F407 that the firmware uses, written from the reference manual RM0090 (sections named) and, for the
// core, from the programming manual PM0214. Not a copy of the vendor's headers: only what is used is here.
#ifndef GC_REGISTERS_H
#define GC_REGISTERS_H

#include <stdint.h>

typedef volatile uint32_t gc_register;

// RM0090 section 7.3, reset and clock control.
typedef struct {
  gc_register cr, pllcfgr, cfgr, cir, ahb1rstr, ahb2rstr, ahb3rstr, unused0, apb1rstr, apb2rstr, unused1[2];
  gc_register ahb1enr, ahb2enr, ahb3enr, unused2, apb1enr, apb2enr, unused3[2], unused4[6], unused5[2];
  gc_register bdcr, csr;
} gc_rcc;
#define RCC ((gc_rcc *)0x40023800u)
#define RCC_CR_HSEON (1u << 16)
#define RCC_CR_HSERDY (1u << 17)
#define RCC_CR_PLLON (1u << 24)
#define RCC_CR_PLLRDY (1u << 25)
#define RCC_PLLCFGR_HSE (1u << 22)
#define RCC_CFGR_SW_PLL 2u
#define RCC_CFGR_SWS (3u << 2)
#define RCC_CFGR_SWS_PLL (2u << 2)
#define RCC_CFGR_APB1_BY_4 (5u << 10)
#define RCC_CFGR_APB2_BY_2 (4u << 13)
#define RCC_AHB1_GPIOA (1u << 0)
#define RCC_AHB1_GPIOB (1u << 1)
#define RCC_AHB1_GPIOC (1u << 2)
#define RCC_AHB1_GPIOD (1u << 3)
#define RCC_AHB1_GPIOF (1u << 5)
#define RCC_APB1_TIM2 (1u << 0)
#define RCC_APB1_CAN1 (1u << 25)
#define RCC_APB1_CAN2 (1u << 26)
#define RCC_APB1_PWR (1u << 28)
#define RCC_APB2_SPI1 (1u << 12)
#define RCC_APB2_SYSCFG (1u << 14)
#define RCC_APB2_TIM10 (1u << 17)
#define RCC_CSR_RMVF (1u << 24)
#define RCC_CSR_BORRSTF (1u << 25)
#define RCC_CSR_PORRSTF (1u << 27)
#define RCC_CSR_SFTRSTF (1u << 28)
#define RCC_CSR_IWDGRSTF (1u << 29)

// RM0090 section 5.4, power control.
typedef struct {
  gc_register cr, csr;
} gc_pwr;
#define PWR ((gc_pwr *)0x40007000u)
#define PWR_CR_PVDE (1u << 4)
#define PWR_CR_PVD_2V9 (7u << 5)
#define PWR_CR_VOS (1u << 14)
#define PWR_CSR_PVDO (1u << 2)

// RM0090 section 3.9, flash interface.
typedef struct {
  gc_register acr, keyr, optkeyr, sr, cr, optcr;
} gc_flash_registers;
#define FLASH ((gc_flash_registers *)0x40023C00u)
#define FLASH_ACR_5_WAITS 5u
#define FLASH_ACR_PREFETCH (1u << 8)
#define FLASH_ACR_ICACHE (1u << 9)
#define FLASH_ACR_DCACHE (1u << 10)
#define FLASH_KEY1 0x45670123u
#define FLASH_KEY2 0xCDEF89ABu
#define FLASH_SR_ERRORS 0xF2u
#define FLASH_SR_BSY (1u << 16)
#define FLASH_CR_PG (1u << 0)
#define FLASH_CR_SER (1u << 1)
#define FLASH_CR_SECTOR_SHIFT 3u
#define FLASH_CR_WORDS (2u << 8)
#define FLASH_CR_STRT (1u << 16)
#define FLASH_CR_LOCK (1u << 31)
#define FLASH_OPTION_KEY1 0x08192A3Bu
#define FLASH_OPTION_KEY2 0x4C5D6E7Fu
#define FLASH_OPTCR_LOCK (1u << 0)
#define FLASH_OPTCR_START (1u << 1)
#define FLASH_OPTCR_BROWN_OUT (3u << 2)  // 3: off, 0: reset below 2.7 to 2.9 V

// RM0090 section 8.4, pins.
typedef struct {
  gc_register moder, otyper, ospeedr, pupdr, idr, odr, bsrr, lckr, afrl, afrh;
} gc_gpio;
#define GPIOA ((gc_gpio *)0x40020000u)
#define GPIOB ((gc_gpio *)0x40020400u)
#define GPIOD ((gc_gpio *)0x40020C00u)
#define GPIOF ((gc_gpio *)0x40021400u)

// RM0090 section 9.3, which port a pin's interrupt comes from; section 12.3, interrupts of pins.
typedef struct {
  gc_register memrmp, pmc, exticr[4];
} gc_syscfg;
#define SYSCFG ((gc_syscfg *)0x40013800u)
typedef struct {
  gc_register imr, emr, rtsr, ftsr, swier, pr;
} gc_exti;
#define EXTI ((gc_exti *)0x40013C00u)

// RM0090 sections 18.4 and 19.5, timers 2 and 10.
typedef struct {
  gc_register cr1, cr2, smcr, dier, sr, egr, ccmr1, ccmr2, ccer, cnt, psc, arr, unused, ccr1, ccr2, ccr3, ccr4;
} gc_timer;
#define TIM2 ((gc_timer *)0x40000000u)
#define TIM10 ((gc_timer *)0x40014400u)
#define TIM_CR1_CEN 1u
#define TIM_EGR_UG 1u
#define TIM_CC1_ENABLE 1u
#define TIM_CCMR1_PWM (6u << 4)
#define TIM_CCMR1_PRELOAD (1u << 3)

// RM0090 section 28.5, SPI.
typedef struct {
  gc_register cr1, cr2, sr, dr;
} gc_spi;
#define SPI1 ((gc_spi *)0x40013000u)
#define SPI_CR1_CPHA (1u << 0)
#define SPI_CR1_CPOL (1u << 1)
#define SPI_CR1_MASTER (1u << 2)
#define SPI_CR1_BY_16 (3u << 3)
#define SPI_CR1_ENABLE (1u << 6)
#define SPI_CR1_SSI (1u << 8)
#define SPI_CR1_SSM (1u << 9)
#define SPI_SR_RXNE (1u << 0)

// RM0090 section 32.9, bxCAN.
typedef struct {
  gc_register ir, dtr, dlr, dhr;
} gc_mailbox;
typedef struct {
  gc_register mcr, msr, tsr, rf0r, rf1r, ier, esr, btr, unused0[88];
  gc_mailbox tx[3];
  gc_mailbox rx[2];
  gc_register unused1[12], fmr, fm1r, unused2, fs1r, unused3, ffa1r, unused4, fa1r, unused5[8];
  gc_register filters[56];
} gc_can_registers;
#define CAN1 ((gc_can_registers *)0x40006400u)
#define CAN2 ((gc_can_registers *)0x40006800u)
#define CAN_MCR_INRQ (1u << 0)
#define CAN_MCR_TXFP (1u << 2)
#define CAN_MCR_ABOM (1u << 6)
#define CAN_MSR_INAK (1u << 0)
#define CAN_TSR_EMPTY_SHIFT 26u
#define CAN_TSR_REQUESTS_DONE ((1u << 0) | (1u << 8) | (1u << 16))
#define CAN_RFR_PENDING 3u
#define CAN_RFR_RELEASE (1u << 5)
#define CAN_IER_TMEIE (1u << 0)
#define CAN_IER_FMPIE0 (1u << 1)
#define CAN_ESR_BOFF (1u << 2)
#define CAN_IR_TXRQ (1u << 0)
#define CAN_IR_RTR (1u << 1)
#define CAN_IR_IDE (1u << 2)
#define CAN_IR_ID_SHIFT 21u

// RM0090 section 21.4, independent watchdog.
typedef struct {
  gc_register kr, pr, rlr, sr;
} gc_iwdg;
#define IWDG ((gc_iwdg *)0x40003000u)
#define IWDG_START 0xCCCCu
#define IWDG_UNLOCK 0x5555u
#define IWDG_FEED 0xAAAAu

// RM0090 section 39.1, unique number of the chip.
#define UNIQUE_ID ((const volatile uint32_t *)0x1FFF7A10u)

// PM0214 sections 4.3 to 4.6: interrupts, system control, SysTick, access to the FPU.
#define NVIC_ISER ((gc_register *)0xE000E100u)
#define NVIC_ISPR ((gc_register *)0xE000E200u)
#define NVIC_IPR ((volatile uint8_t *)0xE000E400u)
#define SCB_AIRCR (*(gc_register *)0xE000ED0Cu)
#define SCB_SHPR ((volatile uint8_t *)0xE000ED18u)
#define SCB_CPACR (*(gc_register *)0xE000ED88u)
#define SCB_AIRCR_RESET 0x05FA0004u
#define SYSTICK_CTRL (*(gc_register *)0xE000E010u)
#define SYSTICK_LOAD (*(gc_register *)0xE000E014u)
#define SYSTICK_VAL (*(gc_register *)0xE000E018u)

// RM0090 section 12.2, numbers of the interrupts.
enum { IRQ_CAN1_TX = 19, IRQ_CAN1_RX0 = 20, IRQ_EXTI9_5 = 23, IRQ_TIM2 = 28, IRQ_CAN2_TX = 63, IRQ_CAN2_RX0 = 64, IRQ_COUNT = 82 };

#endif
