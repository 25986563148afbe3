#include "equilibrium.h"

#include "../core/maths.h"
#include "../core/memory.h"
#include "complementarity.h"
#include "tiled_matrix.h"

// Displacements of the tip as fractions of the length, as in reduction/tracking.py.
#define GC_LONGEST_STEP 0.12f
#define GC_TOLERANCE 1e-2f  // what is left at most; the next call takes it away
#define GC_LOST_LONG 40u   // twice the calls without a shape, less those with one: then the tracking starts from the straight robot
#define GC_SLIDING_AT_REST 1e-9f   // N: a tension that is rounding error
#define GC_SLIDING_REVERSAL 5e-4f  // of the length: way of a cable from no friction to whole

void gc_equilibrium_reset(gc_equilibrium *state, const gc_model *model) {
  gc_zero(state, sizeof *state);
  state->model = model;
  gc_creep_reset(&state->creep);
  for (uint32_t i = 0; i < model->modes; ++i) {
    state->factor[i * (i + 1u) / 2u + i] = 1.0f;  // the stiffness at rest is the identity
  }
  for (uint32_t i = 0; i < model->cables; ++i) {
    state->wound[i] = __builtin_nanf("");
  }
}

// Update the direction in which cables with friction slide, as Sliding.after in src/gravcomp/cables/friction.py.
static void slide(gc_equilibrium *state, const float *wound) {
  const float way = GC_SLIDING_REVERSAL * state->model->settings->length;
  for (uint32_t i = 0; i < state->model->cables; ++i) {
    if (gc_finite(wound[i])) {
      const float before = gc_finite(state->wound[i]) ? state->wound[i] : state->cables.displacement[i];
      state->pulling[i] = gc_clamp(state->pulling[i] + (wound[i] - before) / way, -1.0f, 1.0f);
    } else if (state->tension[i] > GC_SLIDING_AT_REST) {
      state->pulling[i] = -1.0f;
    }
    state->wound[i] = wound[i];
  }
}

// Return how far (m) the tip moves with a change (r,) of the coordinates.
static float tip_motion(const gc_model *model, const float *change) {
  float squared = 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    const float *row = model->section_change + i * model->modes;
    float moved = 0.0f;
    for (uint32_t a = 0; a < model->modes; ++a) {
      moved += row[a] * change[a];
    }
    squared += moved * moved;
  }
  return gc_sqrt(squared);
}

// Write the change (r,) from q to the equilibrium of the linear model, and its tensions (m,). Returns whether there is one.
static bool linear_step(gc_equilibrium *state, const float *gravity, const float *wound, float *change, float *tension) {
  const gc_model *model = state->model;
  const uint32_t r = model->modes, m = model->cables;
  const float(*of_load)[GC_MODES_MAX] = (const float(*)[GC_MODES_MAX])(state->answer + m);
  for (uint32_t a = 0; a < r; ++a) {
    change[a] = ((of_load[0][a] * gravity[0] + of_load[1][a] * gravity[1]) + of_load[2][a] * gravity[2]) - of_load[3][a];
  }
  float lack[GC_CABLES_MAX];
  bool held[GC_CABLES_MAX];
  gc_zero(lack, sizeof lack);
  gc_zero(held, sizeof held);
  for (uint32_t i = 0; i < m; ++i) {
    held[i] = gc_finite(wound[i]);
    state->taut[i] = held[i] && state->tension[i] > 0.0f;
    if (held[i]) {
      float moved = 0.0f;
      for (uint32_t a = 0; a < r; ++a) {
        moved += state->cables.jacobian[i][a] * change[a];
      }
      lack[i] = (wound[i] - state->cables.displacement[i]) - moved;
    }
  }
  if (!gc_taut_tensions(m, (const float(*)[GC_CABLES_MAX])state->compliance, lack, held, state->taut, tension)) {
    return false;
  }
  for (uint32_t i = 0; i < m; ++i) {
    for (uint32_t a = 0; a < r; ++a) {
      change[a] += state->answer[i][a] * tension[i];
    }
  }
  return true;
}

// Solve for the answers of q to the tensions, to gravity and to the elastic forces.
static void solve_answers(gc_equilibrium *state) {
  const gc_model *model = state->model;
  const uint32_t r = model->modes, m = model->cables;
  const float *loads[GC_ANSWERS_MAX];
  for (uint32_t i = 0; i < m; ++i) {
    loads[i] = state->cables.force_jacobian[i];
  }
  for (uint32_t i = 0; i < 3u; ++i) {
    loads[m + i] = model->weight + i * r;
  }
  loads[m + 3u] = state->elasticity.force;
  for (uint32_t first = 0; first < m + 4u; first += GC_COLUMNS) {
    float columns[GC_MODES_MAX][GC_COLUMNS];
    const uint32_t count = m + 4u - first < GC_COLUMNS ? m + 4u - first : GC_COLUMNS;
    for (uint32_t a = 0; a < r; ++a) {
      for (uint32_t c = 0; c < GC_COLUMNS; ++c) {
        columns[a][c] = c < count ? loads[first + c][a] : 0.0f;
      }
    }
    gc_solve(state->factor, r, columns);
    for (uint32_t a = 0; a < r; ++a) {
      for (uint32_t c = 0; c < count; ++c) {
        state->answer[first + c][a] = columns[a][c];
      }
    }
  }
}

// Factorise the stiffness at q. Where what is known of the law's part does not fit the shape, the step goes without it. Returns false
// where the stiffness is not positive definite.
static bool factorise(gc_equilibrium *state) {
  const gc_model *model = state->model;
  gc_elasticity_stiffness(model, &state->elasticity, state->stiffness);
  gc_cables_add_stiffness(model, &state->cables, state->tension, state->stiffness);
  if (model->law_points > 0u) {
    gc_law_deviation_add_stiffness(model, &state->law, state->stiffness, 1.0f);
    if (gc_factorise(state->stiffness, model->modes, state->factor)) {
      return true;
    }
    gc_law_deviation_add_stiffness(model, &state->law, state->stiffness, -1.0f);
  }
  return gc_factorise(state->stiffness, model->modes, state->factor);
}

// Evaluate forces, cables and stiffness at q, and the response of the shape to the tensions. Returns false where the stiffness
// is not positive definite.
static bool evaluate(gc_equilibrium *state) {
  const gc_model *model = state->model;
  const uint32_t r = model->modes, m = model->cables;
  gc_elasticity_at(model, state->q, &state->creep, &state->elasticity);
  if (model->law_points > 0u) {
    gc_law_deviation_at(model, state->q, &state->law, state->elasticity.force);
  }
  gc_cables_at(model, state->q, state->pulling, &state->cables);
  if (!factorise(state)) {
    return false;
  }
  solve_answers(state);
  for (uint32_t i = 0; i < m; ++i) {
    for (uint32_t k = 0; k < m; ++k) {
      float sum = i == k ? state->cables.stretch[i] : 0.0f;
      for (uint32_t a = 0; a < r; ++a) {
        sum += state->cables.jacobian[i][a] * state->answer[k][a];
      }
      state->compliance[i][k] = sum;
    }
  }
  return true;
}

// Write what the tip's section says of position and direction, and their response, at q plus the correction.
static void observe(const gc_equilibrium *state, gc_shape *shape) {
  const gc_model *model = state->model;
  const uint32_t r = model->modes, m = model->cables;
  float section[9], moved[9][GC_CABLES_MAX];
  for (uint32_t i = 0; i < 9u; ++i) {
    const float *row = model->section_change + i * r;
    float value = 0.0f;
    for (uint32_t a = 0; a < r; ++a) {
      value += row[a] * (state->q[a] + state->correction[a]);
    }
    section[i] = model->section_rest[i] + value;
    for (uint32_t k = 0; k < m; ++k) {
      float change = 0.0f;
      for (uint32_t a = 0; a < r; ++a) {
        change += row[a] * state->answer[k][a];
      }
      moved[i][k] = change;
    }
  }
  const float *f1 = section + 3, *f2 = section + 6;
  float d[3] = {f1[1] * f2[2] - f1[2] * f2[1], f1[2] * f2[0] - f1[0] * f2[2], f1[0] * f2[1] - f1[1] * f2[0]};
  const float inverse = 1.0f / gc_sqrt((d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]);
  for (uint32_t i = 0; i < 3u; ++i) {
    d[i] *= inverse;
    shape->tip[i] = section[i];
    shape->direction[i] = d[i];
  }
  for (uint32_t k = 0; k < m; ++k) {
    float turned[3], along = 0.0f;
    for (uint32_t i = 0; i < 3u; ++i) {
      const uint32_t a = (i + 1u) % 3u, b = (i + 2u) % 3u;
      turned[i] = (moved[3u + a][k] * f2[b] - moved[3u + b][k] * f2[a]) + (f1[a] * moved[6u + b][k] - f1[b] * moved[6u + a][k]);
      along += d[i] * turned[i];
    }
    for (uint32_t i = 0; i < 3u; ++i) {
      shape->effector_compliance[i][k] = moved[i][k];
      shape->effector_compliance[3u + i][k] = (turned[i] - d[i] * along) * inverse;
    }
  }
}

// Write the response of the backbone's length to the tensions.
static void observe_length(const gc_equilibrium *state, gc_shape *shape) {
  const gc_model *model = state->model;
  const uint32_t r = model->modes;
  float row[GC_MODES_MAX], before[3] = {0.0f, 0.0f, 0.0f};
  for (uint32_t a = 0; a < r; ++a) {
    row[a] = 0.0f;
  }
  for (uint32_t point = 0; point < model->points; ++point) {
    const float *change = model->point_change + (size_t)point * 3u * r;
    float now[3], along[3], length = 0.0f;
    for (uint32_t i = 0; i < 3u; ++i) {
      now[i] = model->point_rest[3u * point + i];
      for (uint32_t a = 0; a < r; ++a) {
        now[i] += change[i * r + a] * (state->q[a] + state->correction[a]);
      }
      along[i] = now[i] - before[i];
      length += along[i] * along[i];
      before[i] = now[i];
    }
    const float inverse = point > 0u ? 1.0f / gc_sqrt(length) : 0.0f;
    for (uint32_t i = 0; point > 0u && i < 3u; ++i) {
      const float *earlier = change - 3u * r;
      const float part = along[i] * inverse;
      for (uint32_t a = 0; a < r; ++a) {
        row[a] += part * (change[i * r + a] - earlier[i * r + a]);
      }
    }
  }
  for (uint32_t k = 0; k < model->cables; ++k) {
    shape->lengthening[k] = 0.0f;
    for (uint32_t a = 0; a < r; ++a) {
      shape->lengthening[k] += row[a] * state->answer[k][a];
    }
  }
}

// Write tensions and displacements of the cables, and their compliance.
static void describe_cables(const gc_equilibrium *state, const float *tension, gc_shape *shape) {
  const gc_model *model = state->model;
  for (uint32_t i = 0; i < model->cables; ++i) {
    float moved = 0.0f;
    for (uint32_t a = 0; a < model->modes; ++a) {
      moved += state->cables.jacobian[i][a] * state->correction[a];
    }
    shape->tension[i] = tension[i];
    shape->displacement[i] = (state->cables.displacement[i] + moved) + state->cables.stretch[i] * tension[i];
    for (uint32_t k = 0; k < model->cables; ++k) {
      shape->compliance[i][k] = state->compliance[i][k];
    }
  }
}

// Step to the new load from the last shape. Returns the motion of the tip in m, NaN where there is no step.
static float step_to_load(gc_equilibrium *state, const float *gravity, const float *wound) {
  const gc_model *model = state->model;
  float change[GC_MODES_MAX], tension[GC_CABLES_MAX];
  if (!linear_step(state, gravity, wound, change, tension)) {
    return __builtin_nanf("");
  }
  const float size = tip_motion(model, change), longest = GC_LONGEST_STEP * model->settings->length;
  if (!gc_finite(size)) {
    return size;
  }
  const float share = size > longest ? longest / size : 1.0f;
  for (uint32_t a = 0; a < model->modes; ++a) {
    state->q[a] += share * change[a];
  }
  for (uint32_t i = 0; i < model->cables; ++i) {
    state->tension[i] += share * (tension[i] - state->tension[i]);
  }
  return share * size;
}

// Whether the shape q plus a correction, NULL: none, is inside the range that the model was trained for.
static bool inside(const gc_model *model, const float *q, const float *correction) {
  float squared = 0.0f;
  for (uint32_t a = 0; a < model->modes; ++a) {
    const float x = q[a] + (correction != NULL ? correction[a] : 0.0f);
    squared += x * x;
  }
  return squared <= model->settings->reach * model->settings->reach;
}

// Let the material remember the strain at q plus the correction.
static void remember(gc_equilibrium *state) {
  const gc_model *model = state->model;
  float strain[GC_STRAINS_MAX];
  for (uint32_t k = 0; k < model->strains; ++k) {
    const float(*jacobian)[GC_TILE] = (const float(*)[GC_TILE])state->elasticity.jacobian[k / GC_TILE];
    strain[k] = state->elasticity.strain[k];
    for (uint32_t a = 0; a < model->modes; ++a) {
      strain[k] += jacobian[a][k % GC_TILE] * state->correction[a];
    }
  }
  gc_creep_end(&state->creep, model, strain);
}

// Go back to the last shape near an equilibrium, which the next call evaluates; where that has not helped, to the straight robot.
static void go_back(gc_equilibrium *state) {
  state->lost += 2u;
  if (state->lost < GC_LOST_LONG) {
    gc_copy(state->q, state->safe_q, sizeof state->q);
    gc_copy(state->tension, state->safe_tension, sizeof state->tension);
    return;
  }
  const gc_creep creep = state->creep;
  gc_equilibrium_reset(state, state->model);
  state->creep = creep;  // the material has crept, whatever the tracking lost
}

void gc_equilibrium_step(gc_equilibrium *state, const float *full_gravity, const float *full_wound, float interval,
                         gc_shape *shape) {
  const gc_model *model = state->model;
  const float length = model->settings->length;
  state->loaded = state->loaded < GC_LOADING_STEPS ? state->loaded + 1u : GC_LOADING_STEPS;
  const float share = (float)state->loaded / (float)GC_LOADING_STEPS;
  const float gravity[3] = {share * full_gravity[0], share * full_gravity[1], share * full_gravity[2]};
  float wound[GC_CABLES_MAX];
  gc_zero(wound, sizeof wound);
  for (uint32_t i = 0; i < model->cables; ++i) {
    wound[i] = share * full_wound[i];
  }
  gc_creep_begin(&state->creep, model, interval);
  if (model->slides) {
    slide(state, wound);
  }
  const float size = state->evaluated ? step_to_load(state, gravity, wound) : 0.0f;
  float tension[GC_CABLES_MAX];
  bool found = gc_finite(size) && inside(model, state->q, NULL) && evaluate(state) &&
               linear_step(state, gravity, wound, state->correction, tension);
  const float corrected = found ? tip_motion(model, state->correction) : 0.0f;
  found = found && gc_finite(corrected);
  state->evaluated = found;
  if (!found) {
    go_back(state);
    shape->converged = false;
    shape->left = length;
    return;
  }
  const float larger = gc_max(size, corrected);
  shape->left = larger > 0.0f ? corrected * (corrected / larger) : 0.0f;
  shape->converged = shape->left <= GC_TOLERANCE * length && inside(model, state->q, state->correction);
  if (shape->converged) {
    state->lost -= state->lost > 0u ? 1u : 0u;
    // At q the stiffness is positive definite; at the equilibrium itself it need not be.
    gc_copy(state->safe_q, state->q, sizeof state->safe_q);
    gc_copy(state->safe_tension, state->tension, sizeof state->safe_tension);
    gc_copy(state->tension, tension, sizeof state->tension);
    observe(state, shape);
    observe_length(state, shape);
    describe_cables(state, tension, shape);
    if (model->branches > 0u) {
      remember(state);
    }
  }
}
