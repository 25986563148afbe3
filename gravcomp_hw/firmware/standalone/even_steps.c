#include "even_steps.h"

#include <stdbool.h>

#include "../core/maths.h"

#define GC_JITTER 0.1f    // RMS of the steps, of the period, from which they are evened
#define GC_SHARE 0.02f    // of a new step in the means
#define GC_GAIN 0.1f      // of the time by which the stamps are ahead
#define GC_NEXT 1.75f     // periods: in a longer step samples are missing
#define GC_WRONG 0.5f     // share of longer steps from which the period is wrong
#define GC_FARTHEST 0.5f  // periods that the time counted may leave that of the stamps

float gc_even_steps_take(gc_even_steps *even, float dt) {
  const float period = even->period;
  if (!(period > 0.0f)) {
    even->period = dt;
    return dt;
  }
  const bool longer = dt > GC_NEXT * period;
  even->longer += GC_SHARE * ((longer ? 1.0f : 0.0f) - even->longer);
  if (even->longer > GC_WRONG) {
    even->period = dt;
    even->jitter = even->longer = 0.0f;
  } else if (!longer) {
    const float off = dt / period - 1.0f;
    even->period = period + GC_SHARE * (dt - period);
    even->jitter += GC_SHARE * (off * off - even->jitter);
  }
  const float waiting = even->ahead + dt;
  float step = waiting;
  if (even->jitter > GC_JITTER * GC_JITTER) {
    const float regular = (float)gc_round(gc_clamp(waiting / period, 1.0f, 1e6f)) * period;
    step = regular + GC_GAIN * (waiting - regular);
    step = gc_clamp(step, waiting - GC_FARTHEST * period, waiting + GC_FARTHEST * period);
  }
  step = step > 0.0f ? step : dt;
  even->ahead = waiting - step;
  return step;
}
