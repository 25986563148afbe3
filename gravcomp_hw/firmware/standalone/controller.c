#include "controller.h"

#include "../core/maths.h"
#include "../core/memory.h"
#include "trigonometry.h"

#define GC_FARTHEST 0.1f             // of the length: farthest that the winches may move the tip in a step
#define GC_LONGEST_INTERVAL 0.1f     // s in which cables are paid out in one step after a pause
#define GC_LARGEST_DAMPING 1e4f      // damping.py
#define GC_SMALLEST_CHANGE 5e-5f     // of the length
#define GC_BACK_AND_FORTH (-0.3f)
#define GC_RATE_MARGIN 2.5e-3f       // of the largest change in a step; limits.py
#define GC_TENSION_MARGIN 2e-4f      // of the limit
#define GC_TRAVEL_MARGIN 2e-5f       // of the travel

void gc_inverse_reset(gc_inverse_controller *controller, const gc_model *model) {
  gc_zero(controller, sizeof *controller);
  controller->model = model;
  controller->damping = 1.0f;
  controller->code = GC_CODE_INACTIVE;
  gc_retreat_reset(&controller->retreat, model->settings);
}

// Limit a displacement to the cable's travel and to what the winch reaches from `previous`, all in m.
static float within_limits(const gc_settings *s, float displacement, float previous, float interval) {
  const float reach = s->displacement_rate * interval;
  const float reachable = gc_clamp(displacement, previous - reach, previous + reach);
  return gc_clamp(reachable, s->displacement_min, s->displacement_max);
}

// Return W tension + free of a cable: its path under the tensions (m,) in N.
static float path_under(const gc_shape *shape, uint32_t m, uint32_t i, const float *tension) {
  float path = shape->displacement[i];
  for (uint32_t k = 0; k < m; ++k) {
    path += shape->compliance[i][k] * (tension[k] - shape->tension[k]);
  }
  return path;
}

// Adapt the damping to the changes (m,) of the last two programmes.
static void observe_damping(gc_inverse_controller *controller, const float *change) {
  float along = 0.0f, now = 0.0f, before = 0.0f;
  const float smallest = GC_SMALLEST_CHANGE * controller->model->settings->length;
  for (uint32_t i = 0; i < controller->model->cables; ++i) {
    along += change[i] * controller->change[i];
    now += change[i] * change[i];
    before += controller->change[i] * controller->change[i];
  }
  const float lengths = gc_sqrt(now) * gc_sqrt(before);
  if (lengths <= smallest * smallest) {
    return;
  }
  if (along < GC_BACK_AND_FORTH * lengths) {
    controller->damping = gc_min(4.0f * controller->damping, GC_LARGEST_DAMPING);
  } else if (along > 0.0f) {
    controller->damping = gc_max(0.97f * controller->damping, 1.0f);
  }
}

// Return the code of a step, as inverse/status.py. tension (m,): of the command; at_rate and at_travel: a limit is reached.
static gc_code evaluate(const gc_model *model, const gc_shape *shape, const gc_target *target, const float *tension,
                        bool at_rate, bool at_travel) {
  const gc_settings *s = model->settings;
  float effector[6], axis[3], distance = 0.0f, chord = 0.0f, length = 0.0f;
  bool held = at_travel;
  for (uint32_t i = 0; i < 6u; ++i) {
    effector[i] = i < 3u ? shape->tip[i] : shape->direction[i - 3u];
    for (uint32_t k = 0; k < model->cables; ++k) {
      effector[i] += shape->effector_compliance[i][k] * (tension[k] - shape->tension[k]);
    }
  }
  for (uint32_t k = 0; k < model->cables; ++k) {
    held = held || tension[k] > (1.0f - GC_TENSION_MARGIN) * s->tension_max;
  }
  if (at_rate && !held) {
    return GC_CODE_AT_LIMIT;
  }
  gc_tip_axis(target, shape->direction, axis);
  for (uint32_t i = 0; i < 3u; ++i) {
    distance += (effector[i] - target->tip[i]) * (effector[i] - target->tip[i]);
    length += effector[3u + i] * effector[3u + i];
  }
  length = gc_sqrt(length);
  for (uint32_t i = 0; i < 3u; ++i) {
    chord += (effector[3u + i] / length - axis[i]) * (effector[3u + i] / length - axis[i]);
  }
  const float tilt = 2.0f * gc_asin(gc_min(1.0f, 0.5f * gc_sqrt(chord)));
  const bool missed = target->tip_weight > 0.0f && gc_sqrt(distance) > s->tolerance;
  if (missed || (target->direction_weight > 0.0f && tilt > s->tilt_tolerance)) {
    return GC_CODE_UNREACHABLE;
  }
  return held ? GC_CODE_AT_LIMIT : GC_CODE_OK;
}

// Take the command of a move that does not go toward the target.
static void recover(gc_inverse_controller *controller, gc_move move, const gc_shape *shape, const float *previous,
                    float interval) {
  const gc_settings *s = controller->model->settings;
  const uint32_t m = controller->model->cables;
  float none[GC_CABLES_MAX];
  gc_zero(none, sizeof none);
  for (uint32_t i = 0; i < m; ++i) {
    float wanted;
    if (move == GC_BACK) {
      wanted = shape->displacement[i] - (shape->tension[i] > 0.0f ? 0.0f : s->slack);
    } else {
      const float free = path_under(shape, m, i, none);
      wanted = (shape->converged ? free : gc_min(free, 0.0f)) - s->slack;
    }
    controller->displacement[i] = within_limits(s, wanted, previous[i], interval);
    controller->tension[i] = shape->tension[i];
  }
  controller->damping = 1.0f;
  controller->code = move == GC_BACK ? GC_CODE_UNREACHABLE : GC_CODE_RELAXING;
}

// Take the command of a solved programme.
static void take(gc_inverse_controller *controller, const gc_inverse_problem *problem, const gc_solution *solution,
                 const gc_shape *shape, const gc_target *target, float interval) {
  const gc_model *model = controller->model;
  const gc_settings *s = model->settings;
  const uint32_t m = model->cables;
  const float reach = s->displacement_rate * interval, margin = GC_TRAVEL_MARGIN * (s->displacement_max - s->displacement_min);
  float tension[GC_CABLES_MAX], change[GC_CABLES_MAX], largest = 0.0f;
  bool at_rate = false, at_travel = false;
  gc_zero(tension, sizeof tension);
  gc_zero(change, sizeof change);
  for (uint32_t i = 0; i < m; ++i) {
    tension[i] = gc_clamp(solution->unknowns[i] * problem->scale[i], problem->tension_lower[i], problem->tension_upper[i]);
  }
  for (uint32_t i = 0; i < m; ++i) {
    // At a bound above 0 the cable stays taut.
    const float below = problem->tension_lower[i] > 0.0f ? 0.0f : solution->below[i];
    const float path = path_under(shape, m, i, tension), unwanted = below * problem->scale[i];
    change[i] = path - shape->displacement[i];
    const float wanted = path - gc_min(s->slack, shape->compliance[i][i] * unwanted), before = controller->displacement[i];
    const float displacement = within_limits(s, wanted, before, interval);
    at_rate = at_rate || gc_abs(displacement - before) > (1.0f - GC_RATE_MARGIN) * reach;
    at_travel = at_travel || displacement > s->displacement_max - margin || displacement < s->displacement_min + margin;
    largest = gc_max(largest, gc_abs(displacement - before));
    controller->displacement[i] = displacement;
  }
  observe_damping(controller, change);
  gc_retreat_observe(&controller->retreat, s, largest, interval);
  // A shorter stride limits the step, not the motors.
  controller->code = evaluate(model, shape, target, tension, at_rate && controller->retreat.stride >= 1.0f, at_travel);
  gc_copy(controller->tension, tension, sizeof tension);
  gc_copy(controller->change, change, sizeof change);
}

// Return the time in s in which no winch alone moves the tip farther than GC_FARTHEST of the length.
static float longest_interval(const gc_model *model, const gc_shape *shape) {
  float ratio = 0.0f;
  for (uint32_t k = 0; k < model->cables; ++k) {
    float squared = 0.0f;
    for (uint32_t i = 0; i < 3u; ++i) {
      squared += shape->effector_compliance[i][k] * shape->effector_compliance[i][k];
    }
    ratio = gc_max(ratio, gc_sqrt(squared) / shape->compliance[k][k]);
  }
  const float speed = model->settings->displacement_rate * ratio;
  return speed > 0.0f ? GC_FARTHEST * model->settings->length / speed : GC_LONGEST_INTERVAL;
}

void gc_inverse_step(gc_inverse_controller *controller, const gc_shape *shape, const gc_target *target, float interval) {
  const gc_model *model = controller->model;
  const uint32_t m = model->cables;
  float largest = 0.0f;
  interval = gc_clamp(interval, 0.0f, longest_interval(model, shape));
  for (uint32_t i = 0; i < m; ++i) {
    largest = gc_max(largest, shape->tension[i]);
  }
  const gc_move move = gc_retreat_move(&controller->retreat, model->settings, shape->converged, target, shape->tip, largest);
  if (shape->converged) {
    interval *= controller->retreat.stride;
  }
  if (move != GC_ONWARD) {
    float previous[GC_CABLES_MAX];
    gc_copy(previous, controller->displacement, sizeof previous);
    recover(controller, move, shape, previous, interval);
    return;
  }
  gc_inverse_problem problem;
  gc_solution solution;
  gc_inverse_problem_build(model, shape, target, controller->displacement, interval, controller->damping, &problem);
  const bool solved = gc_programme_solve(&problem.programme, &solution);
  controller->solver_steps = solution.steps;
  if (!solved) {
    gc_retreat_observe(&controller->retreat, model->settings, 0.0f, interval);
    controller->code = GC_CODE_SOLVER_FAILED;  // the last command is kept
    return;
  }
  take(controller, &problem, &solution, shape, target, interval);
}
