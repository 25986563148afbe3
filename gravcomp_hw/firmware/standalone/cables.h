// The cables in reduced coordinates: lengths, Jacobian, friction and stiffness (src/gravcomp/reduction/reduced_cables.py).
#ifndef GC_CABLES_H
#define GC_CABLES_H

#include "model.h"

// The cables at coordinates q.
//
// tangent and length (m) of each piece; mean_share: mean tension along each cable over that at the capstan; displacement (m)
// of the paths; jacobian: its derivative by q; force_jacobian: its transpose times the tensions is the cables' force; stretch:
// elongation under unit tension in m/N.
typedef struct {
  float tangent[GC_PIECES_MAX][3];
  float length[GC_PIECES_MAX];
  float mean_share[GC_CABLES_MAX];
  float displacement[GC_CABLES_MAX];
  float stretch[GC_CABLES_MAX];
  float jacobian[GC_CABLES_MAX][GC_MODES_MAX];
  float force_jacobian[GC_CABLES_MAX][GC_MODES_MAX];
} gc_cables;

// Compute the cables at q (r,). pulling (m,): 1 for a cable that is pulled in, -1 for one that is paid out, 0: no friction.
void gc_cables_at(const gc_model *model, const float *q, const float *pulling, gc_cables *at);

// Add the stiffness of the cables under the tensions (m,) in N to a matrix (r, r) stored by tiles.
//
// A piece of length l has the stiffness tension / l D^T (I - t t^T) D. The table of the model holds the sum of D^T D / l over the
// pieces of a cable at rest: t t^T is left out, which is the stretch of a cable under a tension that is a few percent of the
// body's stiffness. So the Newton step is a little shorter; forces, and with them the equilibrium, do not depend on it.
void gc_cables_add_stiffness(const gc_model *model, const gc_cables *at, const float *tension, float *matrix);

#endif
