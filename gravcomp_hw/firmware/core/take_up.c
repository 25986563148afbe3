#include "take_up.h"

#include "maths.h"
#include "position_loop.h"

#define SPREAD (1.0f / 3.0f)  // of the described backlash, by which that of a gear is larger at most
#define LEAST 0.2f            // of the backlash: what is left loose, and by how much a target moves that stays
#define WAY (1.0f / 3.0f)     // of the rest before: time in which the motor winds in again
#define STAYS 5.8284271f      // (1 + sqrt(2))^2: stays of a target that creeps, after which it rests
#define CREEPS 2.0f           // bands: a target that has gone farther between two steps has not crept
#define LATEST 30.0f          // of the rest: a small step after a long rest is taken up, too
#define BACK (1.0f / 3.0f)    // of the rest: a target that comes back within it has stayed

void gc_take_up_reset(gc_take_up *take_up) { gc_zero(take_up, sizeof *take_up); }

// Observe in which band the target stays now: up to `least` from its middle.
static void stay(gc_take_up *take_up, float target, float least, float rest_time, float dt) {
  gc_stay *const last = &take_up->stay, *const left = &take_up->left;
  if (!take_up->started) {
    *last = (gc_stay){.target = target, .rest = rest_time};
    return;
  }
  take_up->away = gc_min(LATEST * rest_time, take_up->away + dt);
  if (take_up->away > BACK * rest_time || gc_abs(target - left->target) > CREEPS * least) {
    take_up->may_come_back = false;
  }
  if (take_up->may_come_back && gc_abs(target - left->target) <= least) {
    left->since += take_up->away;
    *last = *left;
    take_up->may_come_back = false;
    return;
  }
  const bool crept = gc_abs(target - last->target) <= CREEPS * least;
  if (gc_abs(target - last->target) <= least || (crept && last->phase != GC_TAKEN_UP)) {
    return;
  }
  if (crept && !take_up->may_come_back) {
    take_up->may_come_back = true;
    take_up->left = *last;
    take_up->away = 0.0f;
  }
  const float rest = crept ? gc_min(gc_max(1.0f, STAYS * last->since / rest_time), LATEST) * rest_time : rest_time;
  *last = (gc_stay){.target = target, .rest = rest};
}

// Follow the rotor inside a backlash of `width`.
static void follow(gc_take_up *take_up, float displacement, float width) {
  const float moved = take_up->started ? displacement - take_up->last : 0.0f;
  take_up->loose = gc_min(width, gc_max(0.0f, take_up->loose - moved));
  take_up->last = displacement;
}

static float least_of(const gc_parameters *parameters) { return LEAST * gc_parameter_real(parameters, GC_BACKLASH); }

static bool acts(const gc_parameters *parameters) {
  const bool finer = least_of(parameters) <= gc_position_loop_rest_error(parameters);
  return gc_parameter_real(parameters, GC_TAKE_UP_TIME) > 0.0f && !finer;
}

static bool is_loose(const gc_take_up *take_up, const gc_parameters *parameters) {
  return acts(parameters) && !take_up->stay.done && take_up->loose > least_of(parameters);
}

bool gc_take_up_stays(const gc_take_up *take_up, const gc_parameters *parameters) {
  return !acts(parameters) || take_up->stay.since >= gc_parameter_real(parameters, GC_TAKE_UP_TIME);
}

bool gc_take_up_is_due(const gc_take_up *take_up, const gc_parameters *parameters) {
  return is_loose(take_up, parameters) && take_up->stay.since >= take_up->stay.rest;
}

gc_way gc_take_up_step(gc_take_up *take_up, const gc_parameters *parameters, float target, float displacement, float dt) {
  const float play = gc_parameter_real(parameters, GC_BACKLASH);
  const float rest_time = gc_parameter_real(parameters, GC_TAKE_UP_TIME);
  const float rest_error = gc_position_loop_rest_error(parameters);
  const float width = (1.0f + SPREAD) * play, least = least_of(parameters);
  const float over = width + 2.0f * rest_error, farthest = gc_parameter_real(parameters, GC_DISPLACEMENT_MIN);
  const float out = gc_max(target - over, farthest);  // the target may tremble after the take-up has begun
  gc_way way = {.target = target, .fastest = gc_parameter_real(parameters, GC_VELOCITY_LIMIT)};
  if (!acts(parameters)) {
    return way;
  }
  follow(take_up, displacement, width);
  stay(take_up, target, least, rest_time, dt);
  take_up->started = true;
  gc_stay *const now = &take_up->stay;
  now->since = gc_min(LATEST * rest_time, now->since + dt);
  const bool allowed = !take_up->waits && (gc_take_up_is_due(take_up, parameters) || take_up->joins);
  const bool has_room = target - over >= farthest;
  if (now->phase == GC_TAKEN_UP && allowed && is_loose(take_up, parameters) && has_room) {
    now->phase = GC_TAKE_UP_OUT;
    now->done = true;
  }
  if (now->phase == GC_TAKE_UP_OUT && displacement <= out + rest_error) {
    now->phase = GC_TAKE_UP_IN;
  }
  if (now->phase == GC_TAKE_UP_IN && displacement >= target - rest_error) {
    now->phase = GC_TAKEN_UP;
  }
  if (now->phase == GC_TAKE_UP_OUT) {
    way.target = out;
  } else if (now->phase == GC_TAKE_UP_IN) {
    way.fastest = gc_min(way.fastest, over / (WAY * rest_time));
  } else {
    // It stays on its target.
  }
  return way;
}
