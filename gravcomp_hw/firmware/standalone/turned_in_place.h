// The part of the tip's direction that the cables can turn without moving the tip across or shortening the robot (inverse/programme.py on the host).
#ifndef GC_TURNED_IN_PLACE_H
#define GC_TURNED_IN_PLACE_H

#include "equilibrium.h"

// Multiply the rows (3, m) of the direction and their offset (3,) by D of that module. axis (3,): the target's direction.
void gc_keep_turned_in_place(const gc_shape *shape, uint32_t m, const float *axis, float (*rows)[GC_CABLES_MAX], float *offset);

#endif
