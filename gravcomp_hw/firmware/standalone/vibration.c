#include "vibration.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_MEMORY 1.0f    // s
#define GC_SQUARES 70.0f  // sum of the squares of the weights of a fourth difference: 1, 4, 6, 4, 1

void gc_vibration_interrupt(gc_vibration *vibration, uint32_t kinds) {
  for (uint32_t k = 0; k < kinds; ++k) {
    vibration[k].waits = false;
    vibration[k].known = 0;
  }
}

// Take the next mean (3,) of one kind, dt s long.
static void take(gc_vibration *kind, float dt, const float *mean) {
  float(*last)[3] = kind->last;
  if (kind->known < GC_LAST_MEANS) {
    gc_copy(last[kind->known++], mean, sizeof last[0]);
    return;
  }
  float square = 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    const float difference = mean[i] + ((last[0][i] - 4.0f * (last[1][i] + last[3][i])) + 6.0f * last[2][i]);
    square += difference * difference;
    for (uint32_t k = 1; k < GC_LAST_MEANS; ++k) {
      last[k - 1u][i] = last[k][i];
    }
    last[GC_LAST_MEANS - 1u][i] = mean[i];
  }
  kind->density += dt / (GC_MEMORY + dt) * (square * dt / (3.0f * GC_SQUARES) - kind->density);
}

void gc_vibration_take(gc_vibration *vibration, uint32_t kinds, float dt, const float *value) {
  float mean[3];
  gc_copy(mean, value, sizeof mean);
  for (uint32_t k = 0; k < kinds; ++k, dt *= 2.0f) {
    gc_vibration *kind = &vibration[k];
    take(kind, dt, mean);
    kind->waits = !kind->waits;
    if (kind->waits) {
      gc_copy(kind->waiting, mean, sizeof mean);
      return;
    }
    for (uint32_t i = 0; i < 3u; ++i) {
      mean[i] = 0.5f * (kind->waiting[i] + mean[i]);
    }
  }
}

float gc_vibration_density(const gc_vibration *vibration, uint32_t kinds) {
  float least = vibration[0].density;
  for (uint32_t k = 1; k < kinds; ++k) {
    least = gc_min(least, vibration[k].density);
  }
  return least;
}

float gc_vibration_variance(const gc_vibration *vibration, float period) {
  return period > 0.0f ? vibration[0].density / period : 0.0f;
}
