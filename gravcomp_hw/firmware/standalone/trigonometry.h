// Trigonometry in float32 from additions, multiplications, divisions and roots only: a host and the board agree bit for bit.
#ifndef GC_TRIGONOMETRY_H
#define GC_TRIGONOMETRY_H

// Sine and cosine of x in rad, |x| <= 1e4; errors up to 2e-7 for |x| up to a few turns.
void gc_sin_cos(float x, float *sine, float *cosine);

// Angle in rad of the point (x, y), as C's atan2f; errors up to 3e-7.
float gc_atan2(float y, float x);

// Arc sine in rad of |x| <= 1.
float gc_asin(float x);

// Exponential of |x| <= 80; relative errors up to 2e-7.
float gc_exp(float x);

#endif
