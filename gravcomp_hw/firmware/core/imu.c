#include "imu.h"

#include "heater.h"

static gc_frame axes(uint16_t id, const int16_t counts[3], uint8_t sequence) {
  gc_frame frame = gc_frame_of(id, 8u);
  for (uint32_t axis = 0; axis < 3u; axis++) {
    gc_put16(&frame.data[2u * axis], (uint16_t)counts[axis]);
  }
  frame.data[6] = sequence;
  gc_frame_seal(&frame);
  return frame;
}

void gc_imu_frames(gc_imu *imu, gc_sample *sample, gc_frame frames[3]) {
  imu->answers = true;
  imu->last = sample->time;
  if (sample->temperature != GC_NO_READING) {
    imu->temperature = sample->temperature;
  }
  sample->sequence = imu->sequence++;
  frames[0] = axes(GC_ID_ACCELEROMETER, sample->force, sample->sequence);
  frames[1] = axes(GC_ID_GYROSCOPE, sample->rate, sample->sequence);
  frames[2] = gc_frame_of(GC_ID_TIME, 8u);
  gc_put32(frames[2].data, sample->time);
  gc_put16(&frames[2].data[4], (uint16_t)imu->temperature);
  frames[2].data[6] = sample->sequence;
  gc_frame_seal(&frames[2]);
}

void gc_imu_watch(gc_imu *imu, uint32_t now) {
  // Half a period late counts as missing.
  while (now - imu->last >= GC_SAMPLE_PERIOD + GC_SAMPLE_PERIOD / 2u) {
    imu->last += GC_SAMPLE_PERIOD;
    imu->sequence++;
    imu->answers = false;
    if (now - imu->last > 100u * GC_SAMPLE_PERIOD) {
      imu->last = now - GC_SAMPLE_PERIOD;  // a clock that jumped must not keep the processor here
    }
  }
}
