#include "target.h"

#include "../core/maths.h"
#include "trigonometry.h"

gc_target gc_target_stored(const gc_settings *settings) {
  gc_target target;
  for (uint32_t i = 0; i < 3u; ++i) {
    target.tip[i] = settings->target_tip[i];
    target.direction[i] = settings->target_direction[i];
  }
  target.tip_weight = settings->tip_weight;
  target.direction_weight = settings->direction_weight;
  return target;
}

gc_target gc_target_joystick(const gc_settings *settings, float x, float y) {
  gc_target target = gc_target_stored(settings);
  const float right = gc_finite(x) ? gc_clamp(x, -1.0f, 1.0f) : 0.0f, up = gc_finite(y) ? gc_clamp(y, -1.0f, 1.0f) : 0.0f;
  const float deflection = gc_sqrt(right * right + up * up);
  const float angle = settings->joystick_bend * gc_min(deflection, 1.0f), half = 0.5f * angle;
  const float toward_x = deflection > 0.0f ? right / deflection : 1.0f, toward_y = deflection > 0.0f ? up / deflection : 0.0f;
  float sine, cosine, sine_half, cosine_half;
  gc_sin_cos(angle, &sine, &cosine);
  gc_sin_cos(half, &sine_half, &cosine_half);
  const float chord = settings->length * (half > 1e-3f ? sine_half / half : 1.0f - half * half / 6.0f);
  target.tip[0] = chord * sine_half * toward_x;
  target.tip[1] = chord * sine_half * toward_y;
  target.tip[2] = chord * cosine_half;
  target.direction[0] = sine * toward_x;
  target.direction[1] = sine * toward_y;
  target.direction[2] = cosine;
  return target;
}
