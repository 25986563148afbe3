// What a material that creeps remembers: Maxwell branches on the strains of the model (src/gravcomp/reduction/memory.py).
//
// Branch i has held eta_i of the strain eps of the last step. Over a step it takes eta' = d_i eta + g_i (eps' - eps), so that the
// stress is sigma = a eps' + b with a = 1 + sum rho_i g_i and b = sum rho_i d_i eta_i - (a - 1) eps.
#ifndef GC_CREEP_H
#define GC_CREEP_H

#include "model.h"

// Zero with a scale of 1 is the relaxed state of the straight robot.
typedef struct {
  float held[GC_BRANCHES_MAX][GC_STRAINS_MAX];
  float strain[GC_STRAINS_MAX];  // at the end of the last step
  float scale;                   // a
  float offset[GC_STRAINS_MAX];  // b
  float decay[GC_BRANCHES_MAX];  // d and g over the present step
  float gain[GC_BRANCHES_MAX];
} gc_creep;

// Relax at the straight robot.
void gc_creep_reset(gc_creep *creep);

// Begin a step of `interval` s: set a and b.
void gc_creep_begin(gc_creep *creep, const gc_model *model, float interval);

// End the step where the strain is `strain` (k,).
void gc_creep_end(gc_creep *creep, const gc_model *model, const float *strain);

#endif
