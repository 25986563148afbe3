#include "bmi088.h"

#include "../../core/memory.h"
#include "pins.h"
#include "registers.h"

// Registers of the accelerometer and of the gyroscope.
enum { ACC_CHIP_ID = 0x00, ACC_X = 0x12, ACC_TEMPERATURE = 0x22, ACC_CONF = 0x40, ACC_RANGE = 0x41, ACC_PWR_CONF = 0x7C };
enum { ACC_PWR_CTRL = 0x7D, ACC_RESET = 0x7E };
enum { GYRO_CHIP_ID = 0x00, GYRO_X = 0x02, GYRO_RANGE = 0x0F, GYRO_BANDWIDTH = 0x10, GYRO_RESET = 0x14 };
enum { GYRO_INTERRUPT = 0x15, GYRO_PINS = 0x16, GYRO_MAP = 0x18 };

#define ACC_IS_BMI088 0x1Eu
#define GYRO_IS_BMI088 0x0Fu
#define RESET 0xB6u
#define READ 0x80u
#define WAIT_RESET 60000u  // us
#define WAIT_STEP 1000u    // us
#define SILENT 100000u     // us without an edge: the chip has lost its supply or its settings

static uint8_t exchange(uint8_t byte) {
  SPI1->dr = byte;
  while ((SPI1->sr & SPI_SR_RXNE) == 0u) {
  }
  return (uint8_t)SPI1->dr;
}

static void select(bool gyroscope, bool selected) {
  if (gyroscope) {
    gc_pin_select_gyroscope(selected);
  } else {
    gc_pin_select_accelerometer(selected);
  }
}

static void write(bool gyroscope, uint8_t address, uint8_t value) {
  select(gyroscope, true);
  (void)exchange(address);
  (void)exchange(value);
  select(gyroscope, false);
}

static void read(bool gyroscope, uint8_t address, uint8_t *values, uint32_t count) {
  select(gyroscope, true);
  (void)exchange((uint8_t)(address | READ));
  if (!gyroscope) {
    (void)exchange(0u);  // the accelerometer sends a byte without meaning first
  }
  for (uint32_t i = 0; i < count; i++) {
    values[i] = exchange(0u);
  }
  select(gyroscope, false);
}

static bool answers(bool gyroscope) {
  uint8_t id = 0u;
  read(gyroscope, gyroscope ? GYRO_CHIP_ID : ACC_CHIP_ID, &id, 1u);
  return id == (gyroscope ? GYRO_IS_BMI088 : ACC_IS_BMI088);
}

static int16_t word_at(const uint8_t *bytes) { return (int16_t)(uint16_t)((uint32_t)bytes[1] << 8 | bytes[0]); }

void gc_bmi088_start(gc_bmi088 *chip) {
  gc_zero(chip, sizeof *chip);
  RCC->apb2enr |= RCC_APB2_SPI1;
  SPI1->cr1 = SPI_CR1_MASTER | SPI_CR1_BY_16 | SPI_CR1_CPOL | SPI_CR1_CPHA | SPI_CR1_SSM | SPI_CR1_SSI | SPI_CR1_ENABLE;
}

static void configure(gc_bmi088 *chip, const gc_parameters *parameters, uint32_t now) {
  const uint8_t force_range = (uint8_t)gc_parameter_int(parameters, GC_ACCELEROMETER_RANGE);
  const uint8_t rate_range = (uint8_t)gc_parameter_int(parameters, GC_GYROSCOPE_RANGE);
  chip->due = now + WAIT_STEP;
  switch (chip->step) {
    case 0:
      (void)answers(false);  // the first rising select brings the accelerometer to SPI
      write(false, ACC_RESET, RESET);
      write(true, GYRO_RESET, RESET);
      chip->due = now + WAIT_RESET;
      break;
    case 1:
      (void)answers(false);
      break;
    case 2:
      if (!answers(false) || !answers(true)) {
        chip->step = 0u;
        chip->due = now + SILENT;
        return;
      }
      write(false, ACC_PWR_CTRL, 0x04u);
      break;
    case 3:
      write(false, ACC_PWR_CONF, 0x00u);
      chip->due = now + WAIT_RESET;
      break;
    case 4:
      write(false, ACC_CONF, 0xA8u);  // 100 Hz, low-pass of 40 Hz
      break;
    case 5:
      write(false, ACC_RANGE, force_range);
      write(true, GYRO_RANGE, rate_range);
      break;
    case 6:
      write(true, GYRO_BANDWIDTH, 0x07u);  // 100 Hz, low-pass of 32 Hz
      write(true, GYRO_PINS, 0x01u);       // INT3 push-pull, active high
      write(true, GYRO_MAP, 0x01u);        // data ready on INT3
      write(true, GYRO_INTERRUPT, 0x80u);
      break;
    default:
      chip->ready = true;
      chip->heard = now;
      break;
  }
  chip->step++;
}

void gc_bmi088_tick(gc_bmi088 *chip, const gc_parameters *parameters, uint32_t now) {
  if (chip->ready && now - chip->heard > SILENT) {
    chip->ready = false;
    chip->step = 0u;
    chip->due = now;
  }
  if (!chip->ready && (int32_t)(now - chip->due) >= 0) {
    configure(chip, parameters, now);
  }
}

bool gc_bmi088_read(gc_bmi088 *chip, uint32_t time, gc_sample *sample) {
  uint8_t bytes[6];
  if (!chip->ready) {
    return false;
  }
  gc_zero(sample, sizeof *sample);
  sample->time = time;
  read(false, ACC_X, bytes, 6u);
  for (uint32_t axis = 0; axis < 3u; axis++) {
    sample->force[axis] = word_at(&bytes[2u * axis]);
  }
  read(true, GYRO_X, bytes, 6u);
  for (uint32_t axis = 0; axis < 3u; axis++) {
    sample->rate[axis] = word_at(&bytes[2u * axis]);
  }
  read(false, ACC_TEMPERATURE, bytes, 2u);
  const int32_t raw = (int32_t)bytes[0] * 8 + (int32_t)bytes[1] / 32;  // 11 bits, two's complement
  sample->temperature = (int16_t)(raw > 1023 ? raw - 2048 : raw);
  if (!answers(false)) {
    return false;  // a wire that is open reads as zeros or ones
  }
  chip->heard = time;
  return true;
}
