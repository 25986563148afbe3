// A small dense quadratic programme with bounds on unknowns and rows, by a dual active set.
//
// min 1/2 y^T H y + g^T y   s.t.   lower <= (y, A y) <= upper.
//
// With H = L L^T it is the least distance problem min |v| under M v <= d; the dual active set starts from no active bound
// and adds the bound that is missed most, as DAQP (Arnstrom, Bemporad, Axehill, IEEE TAC 2022). The dual cost rises in every
// step, so no active set comes back, and at most GC_QP_STEPS_MAX steps are taken: the time is bounded whatever the numbers
// are. Where these do not suffice, or the bounds contradict one another, the bounds of the rows become elastic, for as many
// steps again.
#ifndef GC_QUADRATIC_PROGRAMME_H
#define GC_QUADRATIC_PROGRAMME_H

#include "model.h"

#define GC_QP_STEPS_MAX 60u

typedef struct {
  uint32_t size;  // of y, and number of rows
  float hessian[GC_CABLES_MAX][GC_CABLES_MAX];
  float gradient[GC_CABLES_MAX];
  float rows[GC_CABLES_MAX][GC_CABLES_MAX];
  float lower[2u * GC_CABLES_MAX];  // of y, then of the rows
  float upper[2u * GC_CABLES_MAX];
} gc_programme;

typedef struct {
  float unknowns[GC_CABLES_MAX];
  float below[GC_CABLES_MAX];  // multiplier of the lower bound of y, 0 where it is not active
  uint32_t steps;              // taken, elastic ones included
} gc_solution;

// Solve the programme. Returns false where H is not positive definite or the steps do not suffice.
bool gc_programme_solve(const gc_programme *programme, gc_solution *solution);

#endif
