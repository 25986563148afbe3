// Inclination after a start or missing samples, from the velocity since then (src/gravcomp/orientation/alignment.py).
#ifndef GC_ALIGNMENT_H
#define GC_ALIGNMENT_H

#include <stdbool.h>

#define GC_TOGETHER 0.866025404f  // correlation between the slope of a fitted line and its value at the end

// Vectors are in the sensor's frame of the newest sample. Zero is the state before the first sample.
typedef struct {
  bool active, leads;                   // leads: while active, the line gives the inclination
  float shaken;                         // mean square of the specific force's length beyond g, of g
  float elapsed;                        // s, t
  float velocity[3], sum[3], moment[3]; // v in m/s; the integrals of v dt and of t v dt
  float square;                         // integral of v^2 dt
  float force[3], force_square;         // smoothed specific force in m/s^2; integral of its square
  float unsure;                         // variance of v by samples without specific force, (m/s)^2
} gc_alignment;

// Follow the motion over dt s: specific force (3,) in m/s^2.
void gc_alignment_watch(gc_alignment *alignment, float dt, const float *force, float gravity);

// Begin with the first specific force (3,) after a gap. leads: the line gives the inclination.
void gc_alignment_begin(gc_alignment *alignment, const float *force, float gravity, bool leads);

// Take a sample dt s after the last one, with the rate (3,) in rad/s without bias; write a vector (3,) that points up. noise in
// m/s^2/sqrt(Hz): of the specific force, by vibration, or where it cannot be measured and `force` is the likeliest one.
void gc_alignment_take(gc_alignment *alignment, float dt, const float *rate, const float *force, float gravity,
                       float noise, float *up);

// Write the newest velocity (3,) beyond the line in m/s; returns its standard deviation on each axis.
float gc_alignment_motion(const gc_alignment *alignment, float gravity, float *velocity);

// Return the density of a velocity about zero, m/s sqrt(s), that shows the inclination as surely as the line does.
float gc_alignment_velocity_noise(const gc_alignment *alignment, float gravity);

// Return the standard deviation of the inclination about each horizontal axis, rad.
float gc_alignment_std(const gc_alignment *alignment, float gravity);

#endif
