#include "inverse_problem.h"

#include "../core/maths.h"
#include "turned_in_place.h"

#define GC_ROWS_MAX 6u

// Errors (count,) of the weighted parts of the target without tension, and their change by the tensions (count, m).
typedef struct {
  uint32_t count;
  float jacobian[GC_ROWS_MAX][GC_CABLES_MAX];
  float offset[GC_ROWS_MAX];
} weighted_errors;

static float dot3(const float *a, const float *b) { return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]; }

void gc_tip_axis(const gc_target *target, const float *tip_direction, float *axis) {
  const bool given = dot3(target->direction, target->direction) > 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    axis[i] = given ? target->direction[i] : tip_direction[i];
  }
}

// Subtract `less` times the part along the axis from three rows, and multiply them by the root of the weight.
static void weigh(weighted_errors *errors, uint32_t first, uint32_t m, const float *axis, float less, float weight) {
  const float root = gc_sqrt(weight);
  float *offset = errors->offset + first;
  const float part = less * dot3(axis, offset);
  for (uint32_t i = 0; i < 3u; ++i) {
    offset[i] = root * (offset[i] - part * axis[i]);
  }
  for (uint32_t k = 0; k < m; ++k) {
    float along = 0.0f;
    for (uint32_t i = 0; i < 3u; ++i) {
      along += axis[i] * errors->jacobian[first + i][k];
    }
    for (uint32_t i = 0; i < 3u; ++i) {
      errors->jacobian[first + i][k] = root * (errors->jacobian[first + i][k] - (less * along) * axis[i]);
    }
  }
}

static void weighted(const gc_model *model, const gc_shape *shape, const gc_target *target, weighted_errors *errors) {
  const uint32_t m = model->cables;
  const float less = 1.0f - gc_sqrt(model->settings->axial_weight);
  errors->count = 0;
  for (uint32_t part = 0; part < 2u; ++part) {
    if (!((part == 0u ? target->tip_weight : target->direction_weight) > 0.0f)) {
      continue;
    }
    const uint32_t first = errors->count;
    const float *now = part == 0u ? shape->tip : shape->direction, *wanted = part == 0u ? target->tip : target->direction;
    for (uint32_t i = 0; i < 3u; ++i) {
      const float *row = shape->effector_compliance[3u * part + i];
      float by_tension = 0.0f;
      for (uint32_t k = 0; k < m; ++k) {
        errors->jacobian[first + i][k] = row[k];
        by_tension += row[k] * shape->tension[k];
      }
      errors->offset[first + i] = (now[i] - by_tension) - wanted[i];
    }
    float axis[3];
    gc_tip_axis(target, shape->direction, axis);
    if (part == 0u) {
      // The target's direction is the axis of the robot only near the target; far from it the tip has to move along it.
      const float aligned = gc_max(0.0f, dot3(axis, shape->direction));
      weigh(errors, first, m, axis, less * aligned * aligned, target->tip_weight);
    } else {
      if (target->tip_weight > 0.0f) {
        gc_keep_turned_in_place(shape, m, target->direction, errors->jacobian + first, errors->offset + first);
      }
      weigh(errors, first, m, axis, 0.0f, target->direction_weight);
    }
    errors->count += 3u;
  }
}

// Write Hessian and gradient in N, and the symmetric compliance.
static void quadratic(const gc_model *model, const gc_shape *shape, const weighted_errors *errors, float damping,
                      float (*hessian)[GC_CABLES_MAX], float *gradient, float (*compliance)[GC_CABLES_MAX]) {
  const uint32_t m = model->cables;
  float trace = 0.0f, soft = 0.0f;
  for (uint32_t i = 0; i < m; ++i) {
    gradient[i] = 0.0f;
    for (uint32_t row = 0; row < errors->count; ++row) {
      gradient[i] += 2.0f * errors->jacobian[row][i] * errors->offset[row];
    }
    for (uint32_t k = 0; k < m; ++k) {
      compliance[i][k] = 0.5f * (shape->compliance[i][k] + shape->compliance[k][i]);
      hessian[i][k] = 0.0f;
      for (uint32_t row = 0; row < errors->count; ++row) {
        hessian[i][k] += 2.0f * errors->jacobian[row][i] * errors->jacobian[row][k];
      }
    }
    trace += hessian[i][i];
    soft += compliance[i][i];
  }
  const float scale = trace / soft;
  for (uint32_t i = 0; i < m; ++i) {
    for (uint32_t k = 0; k < m; ++k) {
      hessian[i][k] += scale * model->settings->energy_weight * compliance[i][k];
    }
    const float hold = scale * (damping * model->settings->proximal_weight) * compliance[i][i];
    hessian[i][i] += hold;
    gradient[i] -= hold * shape->tension[i];
  }
}

void gc_inverse_problem_build(const gc_model *model, const gc_shape *shape, const gc_target *target,
                              const float *displacement, float interval, float damping, gc_inverse_problem *problem) {
  const uint32_t m = model->cables;
  const gc_settings *s = model->settings;
  gc_programme *to = &problem->programme;
  weighted_errors errors;
  float hessian[GC_CABLES_MAX][GC_CABLES_MAX], gradient[GC_CABLES_MAX], compliance[GC_CABLES_MAX][GC_CABLES_MAX];
  weighted(model, shape, target, &errors);
  quadratic(model, shape, &errors, damping, hessian, gradient, compliance);
  const float reach = s->displacement_rate * interval, change = s->tension_rate * interval;
  float *scale = problem->scale;
  to->size = m;
  for (uint32_t i = 0; i < m; ++i) {
    scale[i] = 1e-3f / gc_sqrt(0.5f * hessian[i][i]);
    const float held = gc_clamp(shape->tension[i], model->least_tension[i], s->tension_max);
    problem->tension_lower[i] = gc_max(model->least_tension[i], held - change);
    problem->tension_upper[i] = gc_min(s->tension_max, held + change);
  }
  for (uint32_t i = 0; i < m; ++i) {
    float length = 0.0f, free = shape->displacement[i];
    to->gradient[i] = 0.5e6f * gradient[i] * scale[i];
    to->lower[i] = problem->tension_lower[i] / scale[i];
    to->upper[i] = problem->tension_upper[i] / scale[i];
    for (uint32_t k = 0; k < m; ++k) {
      free -= shape->compliance[i][k] * shape->tension[k];
      to->hessian[i][k] = 0.5e6f * hessian[i][k] * scale[i] * scale[k];
      to->rows[i][k] = compliance[i][k] * scale[k];
      length += to->rows[i][k] * to->rows[i][k];
    }
    const float row = 1.0f / gc_sqrt(length);
    for (uint32_t k = 0; k < m; ++k) {
      to->rows[i][k] *= row;
    }
    const float out = gc_max(s->displacement_min, displacement[i] - reach);
    const float in = gc_min(s->displacement_max, gc_max(displacement[i] + reach, shape->displacement[i]));
    to->lower[m + i] = (out - free) * row;
    to->upper[m + i] = (in - free) * row;
  }
}
