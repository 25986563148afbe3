// Arithmetic on float32 that every IEEE processor rounds alike: a host and the board agree bit for bit.
#ifndef GC_MATHS_H
#define GC_MATHS_H

#include <stdbool.h>
#include <stdint.h>

#include "memory.h"

static inline float gc_abs(float x) { return x < 0.0f ? -x : x; }

static inline float gc_min(float a, float b) { return a < b ? a : b; }

static inline float gc_max(float a, float b) { return a > b ? a : b; }

// Limit x to low..high; a NaN gives low.
static inline float gc_clamp(float x, float low, float high) { return x > low ? gc_min(x, high) : low; }

static inline int32_t gc_clamp_int(int32_t x, int32_t low, int32_t high) {
  return x < low ? low : (x > high ? high : x);
}

static inline float gc_sqrt(float x) { return __builtin_sqrtf(x); }

static inline uint32_t gc_bits_of(float x) {
  uint32_t bits;
  gc_copy(&bits, &x, sizeof bits);
  return bits;
}

static inline float gc_float_of(uint32_t bits) {
  float x;
  gc_copy(&x, &bits, sizeof x);
  return x;
}

// Neither infinite nor NaN.
static inline bool gc_finite(float x) { return (gc_bits_of(x) & 0x7F800000u) != 0x7F800000u; }

// Nearest whole number, halves away from zero; |x| < 2^31.
static inline int32_t gc_round(float x) { return (int32_t)(x < 0.0f ? x - 0.5f : x + 0.5f); }

#endif
