#include "retreat.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_SHORTER 0.25f
#define GC_LONGER 1.05f
#define GC_LEAST_STRIDE (1.0f / 256.0f)
#define GC_LOST_TIMES 3u
#define GC_BACK_STEPS 2u
#define GC_SLOW 2e-3f  // of the speed of a fall from the robot's length
#define GC_STILL_STEPS 20u
#define GC_FAR 0.3f  // of the robot's length
#define GC_NO_TENSION 0.004f
#define GC_LITTLE_TENSION 0.02f  // of the largest tension
#define GC_TRIES 3u
#define GC_STANDARD_GRAVITY 9.80665f

static const float SHARES[GC_TRIES] = {0.5f, 0.25f, 0.0f};  // of the tension at which a target is tried again

void gc_retreat_reset(gc_retreat *retreat, const gc_settings *settings) {
  gc_zero(retreat, sizeof *retreat);
  retreat->tip_at_rest[2] = settings->length;
  retreat->stride = 1.0f;
  retreat->until = -1.0f;
}

static float distance(const float *a, const float *b) {
  const float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return gc_sqrt((x * x + y * y) + z * z);
}

// Start paying the cables out if another attempt from there may get nearer to the target.
static void try_again(gc_retreat *retreat, const gc_settings *settings, const float *tip, float largest_tension) {
  const float missed = distance(tip, retreat->target.tip);
  const bool nearer_at_rest = distance(retreat->tip_at_rest, retreat->target.tip) < missed;
  if (retreat->until < 0.0f && retreat->tries < GC_TRIES && retreat->target.tip_weight > 0.0f && nearer_at_rest &&
      missed > GC_FAR * settings->length) {
    retreat->until = gc_max(SHARES[retreat->tries] * largest_tension, GC_NO_TENSION * settings->tension_max);
    ++retreat->tries;
    retreat->lost_times = 0;
  }
}

static bool same(const gc_target *a, const gc_target *b) {
  bool equal = true;
  for (uint32_t i = 0; i < 3u; ++i) {
    equal = equal && !(a->tip[i] != b->tip[i]) && !(a->direction[i] != b->direction[i]);
  }
  return equal;
}

gc_move gc_retreat_move(gc_retreat *retreat, const gc_settings *settings, bool followed, const gc_target *target,
                        const float *tip, float largest_tension) {
  if (!retreat->has_target || !same(target, &retreat->target)) {
    retreat->target = *target;
    retreat->has_target = true;
    retreat->tries = retreat->lost_times = retreat->still = 0;
    retreat->until = -1.0f;
  }
  if (followed && largest_tension <= GC_LITTLE_TENSION * settings->tension_max) {
    gc_copy(retreat->tip_at_rest, tip, sizeof retreat->tip_at_rest);
  }
  if (!followed) {
    ++retreat->lost;
    if (retreat->lost == 1u) {
      ++retreat->lost_times;
      retreat->stride = gc_max(GC_SHORTER * retreat->stride, GC_LEAST_STRIDE);
    }
    if (retreat->lost_times >= GC_LOST_TIMES) {
      try_again(retreat, settings, tip, largest_tension);
    }
    return retreat->lost <= GC_BACK_STEPS ? GC_BACK : GC_PAY_OUT;
  }
  retreat->lost = 0;
  retreat->stride = gc_min(GC_LONGER * retreat->stride, 1.0f);
  if (retreat->still >= GC_STILL_STEPS) {
    retreat->still = 0;
    try_again(retreat, settings, tip, largest_tension);
  }
  if (retreat->until >= 0.0f) {
    if (largest_tension > retreat->until) {
      return GC_PAY_OUT;
    }
    retreat->until = -1.0f;
    retreat->stride = 1.0f;
  }
  return GC_ONWARD;
}

void gc_retreat_observe(gc_retreat *retreat, const gc_settings *settings, float change, float interval) {
  const float slow = GC_SLOW * gc_sqrt(GC_STANDARD_GRAVITY * settings->length);
  retreat->still = change <= slow * interval ? retreat->still + 1u : 0u;
}
