#include "creep.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define LONGEST 100u  // periods; after a longer pause the loop starts again

void gc_creep_reset(gc_creep *creep) {
  gc_zero(creep, sizeof *creep);
  creep->scale = 1.0f;
}

// Set d and g of a step of some periods, from those of one: d^n, and g (1 + d + ... + d^(n - 1)) / n.
static void follow_interval(gc_creep *creep, const gc_model *model, float interval) {
  const float periods = interval / model->settings->period;
  const uint32_t count = (uint32_t)gc_clamp(periods + 0.5f, 1.0f, (float)LONGEST);
  for (uint32_t b = 0; b < model->branches; ++b) {
    const float decay = model->branch[b].decay;
    float power = 1.0f, sum = 0.0f;
    for (uint32_t n = 0; n < count; ++n) {
      sum += power;
      power *= decay;
    }
    creep->decay[b] = power;
    creep->gain[b] = model->branch[b].gain * (sum / (float)count);
  }
}

void gc_creep_begin(gc_creep *creep, const gc_model *model, float interval) {
  if (model->branches == 0u) {
    return;
  }
  follow_interval(creep, model, interval);
  float stiffer = 0.0f;
  for (uint32_t b = 0; b < model->branches; ++b) {
    stiffer += model->branch[b].ratio * creep->gain[b];
  }
  creep->scale = 1.0f + stiffer;
  for (uint32_t k = 0; k < model->strains; ++k) {
    float offset = -stiffer * creep->strain[k];
    for (uint32_t b = 0; b < model->branches; ++b) {
      offset += model->branch[b].ratio * creep->decay[b] * creep->held[b][k];
    }
    creep->offset[k] = offset;
  }
}

void gc_creep_end(gc_creep *creep, const gc_model *model, const float *strain) {
  for (uint32_t k = 0; k < model->strains; ++k) {
    const float change = strain[k] - creep->strain[k];
    for (uint32_t b = 0; b < model->branches; ++b) {
      creep->held[b][k] = creep->decay[b] * creep->held[b][k] + creep->gain[b] * change;
    }
    creep->strain[k] = strain[k];
  }
}
