// What the robot is to keep: position and direction of its tip in soft_base (src/gravcomp/inverse/target.py).
#ifndef GC_TARGET_H
#define GC_TARGET_H

#include "settings.h"

typedef struct {
  float tip[3];        // m
  float direction[3];  // unit vector; zeros: free
  float tip_weight;
  float direction_weight;  // m^2
} gc_target;

// Return the target that is stored with the model.
gc_target gc_target_stored(const gc_settings *settings);

// Return the target of constant curvature for a joystick at x and y, each limited to -1 to 1: the robot bends toward (x, y)
// in soft_base, by the settings' angle at full deflection.
gc_target gc_target_joystick(const gc_settings *settings, float x, float y);

#endif
