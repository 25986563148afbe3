// Which cables are taut: complementarity of tension and slack (src/gravcomp/cables/slack.py).
#ifndef GC_COMPLEMENTARITY_H
#define GC_COMPLEMENTARITY_H

#include "model.h"

#define GC_PIVOTS_MAX 64u

// Write the tensions (m,) in N that give cables the displacements they lack. Returns false where more than GC_PIVOTS_MAX
// pivots would be needed; the tensions are then 0.
//
// compliance (m, m) in m/N; lack (m,) in m; held (m,): cables that can be taut; taut (m,): first guess, overwritten.
bool gc_taut_tensions(uint32_t m, const float (*compliance)[GC_CABLES_MAX], const float *lack, const bool *held, bool *taut,
                      float *tension);

#endif
