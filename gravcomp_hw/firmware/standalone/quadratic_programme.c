#include "quadratic_programme.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_BOUNDS_MAX (2u * GC_CABLES_MAX)
#define GC_ACTIVE_MAX GC_BOUNDS_MAX
#define GC_ELASTIC 1e-4f   // inverse cost of a row's violation, as the inverse problem's on the host
#define GC_MISSED 2e-5f    // a bound that is missed by less is kept
#define GC_FARTHEST 1e12f  // a multiplier that may grow so far belongs to bounds that contradict one another
#define GC_DEPENDENT 1e-6f // of its square: what is left of a bound's row that depends on the others

// The problem in v = L^T y + L^-1 g: |v| is least under lower <= m v <= upper.
typedef struct {
  uint32_t n, bounds;
  float factor[GC_CABLES_MAX][GC_CABLES_MAX];
  float m[GC_BOUNDS_MAX][GC_CABLES_MAX];
  float lower[GC_BOUNDS_MAX], upper[GC_BOUNDS_MAX];
  float shift[GC_CABLES_MAX];  // L^-1 g
} distance_problem;

// Active bounds: which, on which side (1 upper, -1 lower), and their multipliers.
typedef struct {
  uint32_t count;
  uint32_t which[GC_ACTIVE_MAX];
  float side[GC_ACTIVE_MAX];
  float multiplier[GC_ACTIVE_MAX];
} active_set;

// Replace b (n,) by L^-1 b.
static void forward(const distance_problem *p, float *b) {
  for (uint32_t i = 0; i < p->n; ++i) {
    for (uint32_t k = 0; k < i; ++k) {
      b[i] -= p->factor[i][k] * b[k];
    }
    b[i] /= p->factor[i][i];
  }
}

static bool set_up(const gc_programme *programme, distance_problem *p) {
  const uint32_t n = p->n = programme->size;
  p->bounds = 2u * n;
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t k = 0; k <= i; ++k) {
      float left = programme->hessian[i][k];
      for (uint32_t c = 0; c < k; ++c) {
        left -= p->factor[i][c] * p->factor[k][c];
      }
      if (i == k && !(left > 0.0f)) {
        return false;
      }
      p->factor[i][k] = i == k ? gc_sqrt(left) : left / p->factor[k][k];
    }
    p->shift[i] = programme->gradient[i];
  }
  forward(p, p->shift);
  for (uint32_t b = 0; b < p->bounds; ++b) {
    float moved = 0.0f;
    for (uint32_t i = 0; i < n; ++i) {
      p->m[b][i] = b < n ? (b == i ? 1.0f : 0.0f) : programme->rows[b - n][i];
    }
    forward(p, p->m[b]);
    for (uint32_t i = 0; i < n; ++i) {
      moved += p->m[b][i] * p->shift[i];
    }
    p->lower[b] = programme->lower[b] + moved;
    p->upper[b] = programme->upper[b] + moved;
  }
  return true;
}

// What `multipliers` found.
typedef enum { INDEPENDENT, LAST_DEPENDS, DEPENDENT } dependence;

// Return the scalar product of two active bounds' rows, with what an elastic bound gives way.
static float gram(const distance_problem *p, const active_set *active, uint32_t a, uint32_t b, float elastic) {
  const uint32_t i = active->which[a], k = active->which[b];
  float sum = 0.0f;
  for (uint32_t c = 0; c < p->n; ++c) {
    sum += p->m[i][c] * p->m[k][c];
  }
  return active->side[a] * active->side[b] * sum + (a == b && i >= p->n ? elastic : 0.0f);
}

// Replace b (count,) by the solution of L^T x = b.
static void backward(uint32_t count, const float (*factor)[GC_ACTIVE_MAX], float *b) {
  for (uint32_t a = count; a-- > 0u;) {
    for (uint32_t c = a + 1u; c < count; ++c) {
      b[a] -= factor[c][a] * b[c];
    }
    b[a] /= factor[a][a];
  }
}

// Write the multipliers (count,) with which all active bounds hold. Where the row of the last one depends on the others, write
// the change of the multipliers that leaves v as it is and raises that of the last one by 1.
static dependence multipliers(const distance_problem *p, const active_set *active, float elastic, float *wanted) {
  float factor[GC_ACTIVE_MAX][GC_ACTIVE_MAX];
  for (uint32_t a = 0; a < active->count; ++a) {
    const uint32_t i = active->which[a];
    float right = active->side[a] > 0.0f ? -p->upper[i] : p->lower[i];
    for (uint32_t b = 0; b <= a; ++b) {
      const float whole = gram(p, active, a, b, elastic);
      float left = whole;
      for (uint32_t c = 0; c < b; ++c) {
        left -= factor[a][c] * factor[b][c];
      }
      if (a == b && !(left > GC_DEPENDENT * whole)) {
        if (a + 1u < active->count) {
          return DEPENDENT;
        }
        for (uint32_t c = 0; c < a; ++c) {
          wanted[c] = -factor[a][c];
        }
        backward(a, (const float(*)[GC_ACTIVE_MAX])factor, wanted);
        wanted[a] = 1.0f;
        return LAST_DEPENDS;
      }
      factor[a][b] = a == b ? gc_sqrt(left) : left / factor[b][b];
    }
    for (uint32_t b = 0; b < a; ++b) {
      right -= factor[a][b] * wanted[b];
    }
    wanted[a] = right / factor[a][a];
  }
  backward(active->count, (const float(*)[GC_ACTIVE_MAX])factor, wanted);
  return INDEPENDENT;
}

// Change the multipliers along `change` until one becomes 0, at most by `share` of it, and release that bound. Returns false
// where none does.
static bool released(active_set *active, const float *change, float share) {
  uint32_t blocking = active->count;
  for (uint32_t a = 0; a < active->count; ++a) {
    if (active->multiplier[a] + share * change[a] < 0.0f) {
      share = active->multiplier[a] / -change[a];
      blocking = a;
    }
  }
  if (blocking == active->count) {
    return false;
  }
  for (uint32_t a = 0; a < active->count; ++a) {
    active->multiplier[a] = gc_max(0.0f, active->multiplier[a] + share * change[a]);
  }
  --active->count;
  for (uint32_t a = blocking; a < active->count; ++a) {
    active->which[a] = active->which[a + 1u];
    active->side[a] = active->side[a + 1u];
    active->multiplier[a] = active->multiplier[a + 1u];
  }
  return true;
}

// Write v for the multipliers, and add the bound that it misses most. Returns whether there is one.
static bool missed(const distance_problem *p, active_set *active, float elastic, float *v) {
  float slack[GC_BOUNDS_MAX];
  gc_zero(slack, sizeof slack);
  for (uint32_t i = 0; i < p->n; ++i) {
    v[i] = 0.0f;
  }
  for (uint32_t a = 0; a < active->count; ++a) {
    const uint32_t b = active->which[a];
    const float pull = active->side[a] * active->multiplier[a];
    slack[b] = b >= p->n ? elastic * pull : 0.0f;
    for (uint32_t i = 0; i < p->n; ++i) {
      v[i] -= pull * p->m[b][i];
    }
  }
  float worst = GC_MISSED, side = 1.0f;
  uint32_t found = p->bounds;
  for (uint32_t b = 0; b < p->bounds; ++b) {
    float value = -slack[b];
    for (uint32_t i = 0; i < p->n; ++i) {
      value += p->m[b][i] * v[i];
    }
    const float above = value - p->upper[b], below = p->lower[b] - value;
    if (above > worst || below > worst) {
      bool taken = false;
      for (uint32_t a = 0; a < active->count; ++a) {
        taken = taken || active->which[a] == b;
      }
      if (!taken) {
        worst = gc_max(above, below);
        side = above > below ? 1.0f : -1.0f;
        found = b;
      }
    }
  }
  if (found == p->bounds || active->count == GC_ACTIVE_MAX) {
    return false;
  }
  active->which[active->count] = found;
  active->side[active->count] = side;
  active->multiplier[active->count] = 0.0f;
  ++active->count;
  return true;
}

// Solve with bounds of the rows that give way by `elastic`, 0: that do not. Returns false where they contradict one another
// or the steps do not suffice.
static bool solved(const distance_problem *p, float elastic, active_set *active, float *v, uint32_t *steps) {
  float wanted[GC_ACTIVE_MAX], change[GC_ACTIVE_MAX];
  gc_zero(wanted, sizeof wanted);
  active->count = 0;
  for (uint32_t step = 0; step < GC_QP_STEPS_MAX; ++step) {
    ++*steps;
    const dependence found = multipliers(p, active, elastic, wanted);
    if (found == LAST_DEPENDS && released(active, wanted, GC_FARTHEST)) {
      continue;
    }
    if (found != INDEPENDENT) {
      return false;  // the bounds contradict one another
    }
    for (uint32_t a = 0; a < active->count; ++a) {
      change[a] = wanted[a] - active->multiplier[a];
    }
    if (released(active, change, 1.0f)) {
      continue;
    }
    gc_copy(active->multiplier, wanted, sizeof(float) * active->count);
    if (!missed(p, active, elastic, v)) {
      return true;
    }
  }
  return false;
}

bool gc_programme_solve(const gc_programme *programme, gc_solution *solution) {
  distance_problem p;
  active_set active;
  float v[GC_CABLES_MAX];
  solution->steps = 0;
  if (!set_up(programme, &p) ||
      !(solved(&p, 0.0f, &active, v, &solution->steps) || solved(&p, GC_ELASTIC, &active, v, &solution->steps))) {
    return false;
  }
  const uint32_t n = p.n;
  bool finite = true;
  for (uint32_t i = n; i-- > 0u;) {
    float left = v[i] - p.shift[i];
    for (uint32_t k = i + 1u; k < n; ++k) {
      left -= p.factor[k][i] * solution->unknowns[k];
    }
    solution->unknowns[i] = left / p.factor[i][i];
    solution->below[i] = 0.0f;
    finite = finite && gc_finite(solution->unknowns[i]);
  }
  for (uint32_t a = 0; a < active.count; ++a) {
    if (active.which[a] < n && active.side[a] < 0.0f) {
      solution->below[active.which[a]] = active.multiplier[a];
    }
  }
  return finite;
}
