// Samples of the IMU as frames: counts, stamp at the data-ready edge, temperature, sequence.
#ifndef GC_IMU_H
#define GC_IMU_H

#include <stdbool.h>
#include <stdint.h>

#include "frame.h"

#define GC_SAMPLE_PERIOD 10000u  // us

// One sample as the chip gives it.
typedef struct {
  int16_t force[3];     // accelerometer, counts
  int16_t rate[3];      // gyroscope, counts
  int16_t temperature;  // 0.125 degC, 0 is 23 degC; GC_NO_READING: none yet
  uint8_t sequence;
  uint32_t time;  // us, data-ready edge
  uint8_t force_range;
  uint8_t rate_range;
} gc_sample;

typedef struct {
  uint8_t sequence;      // of the next sample
  uint32_t last;         // us, stamp of the last sample or of the last one that was missed
  int16_t temperature;   // last one that was read
  bool answers;          // the last sample came
} gc_imu;

// Three frames of a sample, in the order in which they are sent; gives the sample its sequence.
void gc_imu_frames(gc_imu *imu, gc_sample *sample, gc_frame frames[3]);

// Count the samples that should have come by now and did not.
void gc_imu_watch(gc_imu *imu, uint32_t now);

#endif
