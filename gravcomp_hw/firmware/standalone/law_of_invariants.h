// Laws of rubber, by the invariants of C (src/gravcomp/materials/invariants.py): their stress without its linear part.
#ifndef GC_LAW_OF_INVARIANTS_H
#define GC_LAW_OF_INVARIANTS_H

#include <stdint.h>

// Constants of a point, times its weight: w (m^3) times Pa. With x = I1 J^(-2/3) - 3,
//   W = c10 x + c20 x^2 + c30 x^3 + c01 (I2 J^(-4/3) - 3) + kappa / 2 (J - 1)^2.
typedef struct {
  float first, shear;  // lambda and mu of small strain
  float c10, c20, c30, c01;
} gc_law;

// Write T = S(E) - lambda tr(E) I - 2 mu E (6,) at Green's strain e (6,), in the order 11 22 33 12 23 13 with doubled shear
// strains, and, where d is not NULL, dT/dE.
void gc_law_deviating_stress(const gc_law *law, const float e[6], float t[6], float (*d)[6]);

#endif
