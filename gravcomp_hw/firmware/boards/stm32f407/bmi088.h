// The Bosch BMI088 on SPI1 [BMI088 data sheet, BST-BMI088-DS001]: set up step by step, read at each data-ready edge.
#ifndef GC_BMI088_H
#define GC_BMI088_H

#include <stdbool.h>
#include <stdint.h>

#include "../../core/board.h"

typedef struct {
  uint32_t step;    // of the set-up
  uint32_t due;     // us, of the next step
  uint32_t heard;   // us, of the last data-ready edge
  bool ready;
} gc_bmi088;

void gc_bmi088_start(gc_bmi088 *chip);

// One step of the set-up when it is due; begins again when no data-ready edge comes.
void gc_bmi088_tick(gc_bmi088 *chip, const gc_parameters *parameters, uint32_t now);

// Read a sample; `time` (us) is that of the edge. False while the chip is not set up, or has lost what was set.
bool gc_bmi088_read(gc_bmi088 *chip, uint32_t time, gc_sample *sample);

#endif
