#include "trigonometry.h"

#include "../core/maths.h"

#define GC_PI 3.14159265358979f
#define GC_HALF_PI 1.57079632679490f

void gc_sin_cos(float x, float *sine, float *cosine) {
  // Cody and Waite: x - n pi / 2 with pi / 2 in three parts.
  const int32_t n = gc_round(x * 0.636619772f);
  const float turns = (float)n;
  const float y = ((x - turns * 1.5703125f) - turns * 4.83751296997e-4f) - turns * 7.54978995489e-8f;
  const float z = y * y;
  const float s = y + y * z * (-1.6666654611e-1f + z * (8.3321608736e-3f - z * 1.9515295891e-4f));
  const float c = 1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  switch ((uint32_t)n & 3u) {
    case 0u: *sine = s, *cosine = c; break;
    case 1u: *sine = c, *cosine = -s; break;
    case 2u: *sine = -s, *cosine = -c; break;
    default: *sine = -c, *cosine = s; break;
  }
}

// Arc tangent of 0 <= x <= 1 (Cephes' polynomial below tan(pi / 8), the angle's difference to pi / 4 above).
static float arc_tangent(float x) {
  float start = 0.0f;
  if (x > 0.414213562f) {
    start = 0.25f * GC_PI;
    x = (x - 1.0f) / (x + 1.0f);
  }
  const float z = x * x;
  return start + (x + x * z * (-3.33329491539e-1f + z * (1.99777106478e-1f + z * (-1.38776856032e-1f + z * 8.05374449538e-2f))));
}

float gc_atan2(float y, float x) {
  const float across = gc_abs(y), along = gc_abs(x);
  float angle = 0.0f;
  if (across > along) {
    angle = GC_HALF_PI - arc_tangent(along / across);
  } else if (along > 0.0f) {
    angle = arc_tangent(across / along);
  }
  if (x < 0.0f) {
    angle = GC_PI - angle;
  }
  return y < 0.0f ? -angle : angle;
}

float gc_asin(float x) { return gc_atan2(x, gc_sqrt(gc_max(0.0f, (1.0f - x) * (1.0f + x)))); }

float gc_exp(float x) {
  const float limited = gc_clamp(x, -80.0f, 80.0f);
  const int32_t n = gc_round(limited * 1.44269504f);
  const float whole = (float)n;
  const float y = (limited - whole * 0.693359375f) + whole * 2.12194440e-4f;
  const float tail = 1.6666665459e-1f + y * (4.1665795894e-2f + y * (8.3334519073e-3f + y * (1.3981999507e-3f + y * 1.9875691500e-4f)));
  const float p = 1.0f + (y + y * y * (0.5f + y * tail));
  return p * gc_float_of((uint32_t)(n + 127) << 23);
}
