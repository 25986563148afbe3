#include "spike_review.h"

#include "../core/maths.h"
#include "../core/memory.h"

#define GC_BOUND 0.5f
#define GC_FROM_MEDIAN 0.75f
#define GC_WITH_IT 0.25f
#define GC_LEFT_OUT 0.1f
#define GC_STRAIGHT 0.1f
#define GC_AROUND 8u  // neighbours whose median counts: four on each side
// Weights of six neighbours and the sample between them: its distance from the polynomial of degree five through them.
#define GC_NEAR 0.75f
#define GC_FAR (-0.3f)
#define GC_FARTHEST 0.05f

#define FIRST GC_REVIEW_BEFORE  // the sample in question, and the first one that may be left out
#define CHOICES (GC_REVIEW_SAMPLES - FIRST)

// Residuals of the samples from FIRST on by all samples, times SCALE: I - X X^+ of the polynomial of degree four through all.
#define SCALE 1716.0f
static const float RESIDUAL[CHOICES][GC_REVIEW_SAMPLES] = {
    {-108.0f, 240.0f, 70.0f, -270.0f, -540.0f, 1108.0f, -450.0f, -150.0f, 100.0f, 0.0f},
    {-90.0f, 142.0f, 115.0f, -55.0f, -270.0f, -450.0f, 1183.0f, -475.0f, -250.0f, 150.0f},
    {30.0f, -90.0f, 17.0f, 115.0f, 70.0f, -150.0f, -475.0f, 983.0f, -650.0f, 150.0f},
    {120.0f, -220.0f, -90.0f, 142.0f, 240.0f, 100.0f, -250.0f, -650.0f, 908.0f, -300.0f},
    {-60.0f, 120.0f, 30.0f, -90.0f, -108.0f, 0.0f, 150.0f, 150.0f, -300.0f, 108.0f},
};

// What one axis says: whether the best fit leaves the sample in question out, and its distance from the best of those that do.
typedef struct {
  bool left_out;
  float off;
} gc_axis_review;

// How far the sample in question is from the curve and from the median of its neighbours, on the axis where it is farthest; by how
// much a cubic is nearer to a sample that is decided than the mean of its neighbours; and the median (3,).
typedef struct {
  float distance, off, bend, median[3];
} gc_look;

void gc_spike_review_reset(gc_spike_review *review) {
  review->count = 0;
  review->mean = 0.0f;
  review->mean_from_median = 0.0f;
  review->bend = review->floor;  // a curve, as long as nothing is known
}

static float median_around(const gc_spike_review *review, uint32_t axis) {
  float sorted[GC_AROUND];
  for (uint32_t k = 0; k < GC_AROUND; ++k) {
    const uint32_t at = FIRST - GC_AROUND / 2u + k;
    const float value = review->samples[at < FIRST ? at : at + 1u][axis];
    uint32_t place = k;
    for (; place > 0u && sorted[place - 1u] > value; --place) {
      sorted[place] = sorted[place - 1u];
    }
    sorted[place] = value;
  }
  return 0.5f * (sorted[GC_AROUND / 2u - 1u] + sorted[GC_AROUND / 2u]);
}

static gc_look look(const gc_spike_review *review) {
  const float(*at)[3] = (const float(*)[3])review->samples + FIRST;
  const float(*before)[3] = (const float(*)[3])review->samples + FIRST - 3;
  gc_look found = {0};
  float from_mean = 0.0f, from_cubic = 0.0f;
  for (uint32_t i = 0; i < 3u; ++i) {
    const float near = GC_NEAR * (at[-1][i] + at[1][i]), far = GC_FAR * (at[-2][i] + at[2][i]);
    const float farthest = GC_FARTHEST * (at[-3][i] + at[3][i]);
    found.distance = gc_max(found.distance, gc_abs(((at[0][i] - near) - far) - farthest));
    found.median[i] = median_around(review, i);
    found.off = gc_max(found.off, gc_abs(at[0][i] - found.median[i]));
    const float next = before[-1][i] + before[1][i], second = before[-2][i] + before[2][i];
    from_mean = gc_max(from_mean, gc_abs(before[0][i] - 0.25f * (next + second)));
    from_cubic = gc_max(from_cubic, gc_abs(before[0][i] - (4.0f * next - second) / 6.0f));
  }
  found.bend = from_mean - from_cubic;
  return found;
}

// Return the review of an axis, where each sample that is left out costs `cost`.
//
// With the residuals e = R x of all samples, the squared residual without the samples L is less by e_L . R_LL^-1 e_L, and their
// distances from that fit are R_LL^-1 e_L (R. D. Cook, S. Weisberg, Residuals and Influence in Regression, 1982, section 2.2).
static gc_axis_review review_of(const gc_spike_review *review, uint32_t axis, float cost) {
  const float ours = review->samples[FIRST][axis];
  float e[CHOICES];
  for (uint32_t a = 0; a < CHOICES; ++a) {
    float sum = 0.0f;
    for (uint32_t k = 0; k < GC_REVIEW_SAMPLES; ++k) {
      sum += RESIDUAL[a][k] * (review->samples[k][axis] - ours);
    }
    e[a] = sum / SCALE;
  }
  const float own = SCALE / RESIDUAL[0][FIRST] * e[0];
  float best = e[0] * own - cost, others = 0.0f, off = own;
  for (uint32_t a = 1; a < CHOICES; ++a) {
    const float alone = SCALE / RESIDUAL[a][FIRST + a] * e[a];
    others = gc_max(others, e[a] * alone - cost);
    for (uint32_t b = 0; b < a; ++b) {
      const float aa = RESIDUAL[a][FIRST + a], bb = RESIDUAL[b][FIRST + b], ab = RESIDUAL[a][FIRST + b];
      const float inverse = SCALE / (aa * bb - ab * ab);
      const float of_a = inverse * (bb * e[a] - ab * e[b]), of_b = inverse * (aa * e[b] - ab * e[a]);
      const float gain = (e[a] * of_a + e[b] * of_b) - 2.0f * cost;
      if (b > 0u) {
        others = gc_max(others, gain);
      } else if (gain > best) {
        best = gain;
        off = of_b;
      }
    }
  }
  return (gc_axis_review){best > others, off};
}

// Put the curve in place of the sample in question on each axis on which that is a spike.
static void decide(gc_spike_review *review, float threshold) {
  float *ours = review->samples[FIRST];
  const float cost = GC_LEFT_OUT * (RESIDUAL[0][FIRST] / SCALE) * (threshold * threshold);
  gc_axis_review axes[3];
  bool any = false;
  for (uint32_t i = 0; i < 3u; ++i) {
    axes[i] = review_of(review, i, cost);
    axes[i].left_out = axes[i].left_out && gc_abs(axes[i].off) > threshold;
    any = any || axes[i].left_out;
  }
  for (uint32_t i = 0; i < 3u; ++i) {
    const bool spike = axes[i].left_out || (any && gc_abs(axes[i].off) > GC_WITH_IT * threshold);
    ours[i] -= spike ? axes[i].off : 0.0f;
  }
}

// Return whether most samples after the one in question are far from the median, too: that is motion which begins.
static bool goes_on(const gc_spike_review *review, const float *median, float least) {
  uint32_t far = 0;
  for (uint32_t k = FIRST + 1u; k < GC_REVIEW_SAMPLES; ++k) {
    const float *after = review->samples[k];
    const float x = gc_abs(after[0] - median[0]), y = gc_abs(after[1] - median[1]), z = gc_abs(after[2] - median[2]);
    far += gc_max(gc_max(x, y), z) > least ? 1u : 0u;
  }
  return 2u * far > GC_REVIEW_AHEAD;
}

bool gc_spike_review_take(gc_spike_review *review, const gc_settings *settings, float dt, const float *value, float *counted) {
  if (review->count == GC_REVIEW_SAMPLES) {
    for (uint32_t k = 1; k < GC_REVIEW_SAMPLES; ++k) {
      gc_copy(review->samples[k - 1u], review->samples[k], sizeof(float[3]));
    }
    --review->count;
  }
  gc_copy(review->samples[review->count++], value, sizeof(float[3]));
  if (review->count < GC_REVIEW_SAMPLES) {
    return false;
  }
  float *ours = review->samples[FIRST];
  const gc_look found = look(review);
  const float floor = review->floor;
  const float threshold = gc_max(floor, settings->spike_ratio * review->mean);
  const float from_median = gc_max(floor, settings->spike_ratio * review->mean_from_median);
  const float part = dt / (settings->spike_time_constant + dt);
  review->mean += part * (gc_min(found.distance, GC_BOUND * threshold) - review->mean);
  review->mean_from_median += part * (gc_min(found.off, GC_BOUND * from_median) - review->mean_from_median);
  review->bend += part * (gc_max(-floor, found.bend) - review->bend);
  const float least = gc_max(floor, GC_FROM_MEDIAN * from_median);
  const bool is_far = found.off > least && found.distance > floor;
  if (review->bend > GC_STRAIGHT * floor || (is_far && goes_on(review, found.median, least))) {
    if (found.distance > threshold) {
      decide(review, review->sure * threshold);
    }
  } else if (is_far) {
    gc_copy(ours, found.median, sizeof(float[3]));  // on all axes: a rest would end at what is left of the spike
  }
  gc_copy(counted, ours, sizeof(float[3]));
  return true;
}
