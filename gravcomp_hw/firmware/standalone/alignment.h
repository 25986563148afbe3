// Inclination after a start or missing samples, from the velocity since then (src/gravcomp/orientation/alignment.py).
#ifndef GC_ALIGNMENT_H
#define GC_ALIGNMENT_H

#include <stdbool.h>

#define GC_SWING 0.3f  // s, about the time that a motion goes in one direction: no line goes on over a longer gap

// The inclination from before a gap, at its end: a vector that points up, in the sensor's frame; variance in rad^2 about each
// horizontal axis; that of the gyroscope's bias in (rad/s)^2 on each axis.
typedef struct {
  float upward[3];
  float variance, bias_variance;
} gc_earlier;

// Vectors are in the sensor's frame of the newest sample. Zero is the state before the first sample.
typedef struct {
  bool active;
  float shaken;                         // mean square of the specific force's length beyond g, of g
  float elapsed;                        // s, t
  float velocity[3], sum[3], moment[3]; // v in m/s; the integrals of v dt and of t v dt
  float square;                         // integral of v^2 dt
  float line[3];                        // points up, as the line says
  bool has_earlier;
  gc_earlier earlier;
  float force[3], force_square;         // smoothed specific force in m/s^2; integral of its square
  float unsure;                         // variance of v by samples without specific force, (m/s)^2
} gc_alignment;

// Follow the motion over dt s: specific force (3,) in m/s^2.
void gc_alignment_watch(gc_alignment *alignment, float dt, const float *force, float gravity);

// Begin with the first specific force (3,); earlier: the inclination from before a gap, or a null pointer.
void gc_alignment_begin(gc_alignment *alignment, const float *force, float gravity, const gc_earlier *earlier);

// Take a sample dt s after the last one, with the rate (3,) in rad/s without bias. noise in m/s^2/sqrt(Hz): of the specific
// force, by vibration, or where it cannot be measured and `force` is the likeliest one; turned: variance of the turn by the
// rate, rad^2.
void gc_alignment_take(gc_alignment *alignment, float dt, const float *rate, const float *force, float gravity, float noise,
                       float turned);

// Write a vector (3,) that points up; return its standard deviation about each horizontal axis, rad.
float gc_alignment_inclination(const gc_alignment *alignment, float gravity, float *up);

// Write the newest velocity (3,) beyond the line along the inclination in m/s, and the correlation of each horizontal one with
// the error of the inclination by which gravity causes it; return the velocity's standard deviation on each axis.
float gc_alignment_motion(const gc_alignment *alignment, float gravity, float *velocity, float *together);

#endif
