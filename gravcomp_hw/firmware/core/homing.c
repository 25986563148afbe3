#include "homing.h"

#include "maths.h"

#define SETTLE 0.25f         // s of winding before the current is sampled; the next such time gives the baseline
#define SMOOTHING 0.02f      // s
#define RISE_TIME 0.04f      // s above the threshold until the cable is taut
#define ARRIVED 0.01f        // of the slack, from the target
#define FARTHEST 0.02f       // of the slack, before the end of the travel
#define PHASE_TIMEOUT 60.0f  // s
#define CANDIDATES 41u
#define REFINEMENTS 3u

static bool is_present(uint8_t present, uint32_t index) { return ((uint32_t)present >> index & 1u) != 0u; }

static void enter(gc_homing *homing, gc_homing_phase phase) {
  homing->phase = phase;
  homing->since = 0.0f;
}

static bool arrived(const gc_motor *motors, const gc_parameters *parameters, uint8_t present) {
  const float near = ARRIVED * gc_parameter_real(parameters, GC_HOMING_SLACK);
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    const float at = gc_motor_displacement(&motors[index], parameters, index);
    if (is_present(present, index) && gc_abs(at - motors[index].target) >= near) {
      return false;
    }
  }
  return true;
}

// Wind the next motor from `index` on; without one, all go to their zero positions.
static void wind_from(gc_homing *homing, gc_motor *motors, const gc_parameters *parameters, uint8_t present,
                      uint32_t index) {
  while (index < GC_MOTORS_MOST && !is_present(present, index)) {
    index++;
  }
  if (index >= GC_MOTORS_MOST) {
    for (uint32_t k = 0; k < GC_MOTORS_MOST; k++) {
      motors[k].target = homing->zeros[k];
    }
    enter(homing, GC_TO_ZERO);
    return;
  }
  enter(homing, GC_WIND);
  homing->motor = index;
  homing->from = gc_motor_displacement(&motors[index], parameters, index);
  motors[index].target = homing->from + gc_parameter_real(parameters, GC_HOMING_TRAVEL) +
                         gc_parameter_real(parameters, GC_HOMING_SLACK);
  homing->count = 0u;
  homing->stride = 1u;
  homing->skipped = 0u;
  homing->smooth = 0.0f;
  homing->baseline = 0.0f;
  homing->baseline_steps = 0u;
  homing->risen = 0.0f;
}

// Keep the sample; when there is no room, every second one goes and half as many are taken from then on.
static void keep(gc_homing *homing, float position, float current) {
  homing->skipped++;
  if (homing->skipped < homing->stride) {
    return;
  }
  homing->skipped = 0u;
  if (homing->count == GC_HOMING_SAMPLES) {
    for (uint32_t i = 0; i < GC_HOMING_SAMPLES / 2u; i++) {
      homing->samples[i] = homing->samples[2u * i];
    }
    homing->count = GC_HOMING_SAMPLES / 2u;
    homing->stride *= 2u;
  }
  homing->samples[homing->count].position = position;
  homing->samples[homing->count].current = current;
  homing->count++;
}

static void wind(gc_homing *homing, gc_motor *motors, const gc_parameters *parameters, float dt) {
  const uint32_t index = homing->motor;
  const float at = gc_motor_displacement(&motors[index], parameters, index);
  const float farthest =
      gc_parameter_real(parameters, GC_HOMING_TRAVEL) + gc_parameter_real(parameters, GC_HOMING_SLACK);
  if (at - homing->from > farthest - FARTHEST * gc_parameter_real(parameters, GC_HOMING_SLACK)) {
    enter(homing, GC_HOMING_FAILED);  // broken, unhooked, or the wrong direction
    return;
  }
  if (homing->since < SETTLE) {
    return;
  }
  const float current = 1e-3f * (float)(gc_motor_direction(parameters, index) * motors[index].rotor.current);
  keep(homing, at, current);
  const bool first = homing->count == 1u && homing->stride == 1u;
  homing->smooth = first ? current : homing->smooth + gc_min(1.0f, dt / SMOOTHING) * (current - homing->smooth);
  if (homing->since < 2.0f * SETTLE) {
    homing->baseline_steps++;
    homing->baseline += (current - homing->baseline) / (float)homing->baseline_steps;
    return;
  }
  const float rise = 1e-3f * (float)gc_parameter_int(parameters, GC_HOMING_RISE);
  homing->risen = homing->smooth - homing->baseline < rise ? 0.0f : homing->risen + dt;
  if (homing->risen < RISE_TIME) {
    return;
  }
  homing->low = homing->samples[0].position;
  homing->high = homing->low;
  for (uint32_t i = 1; i < homing->count; i++) {
    homing->low = gc_min(homing->low, homing->samples[i].position);
    homing->high = gc_max(homing->high, homing->samples[i].position);
  }
  homing->candidate = 0u;
  homing->refinements = 0u;
  homing->cost = -1.0f;
  motors[index].target = at;  // it waits for the fit
  enter(homing, GC_FIT);
}

// Sum of squared residuals of the best line through the ramp from `knee` on.
static float cost_of(const gc_homing *homing, float knee) {
  const float count = (float)homing->count;
  float mean_ramp = 0.0f;
  float mean_current = 0.0f;
  for (uint32_t i = 0; i < homing->count; i++) {
    mean_ramp += gc_max(0.0f, homing->samples[i].position - knee);
    mean_current += homing->samples[i].current;
  }
  mean_ramp /= count;
  mean_current /= count;
  float ramp_ramp = 0.0f;
  float ramp_current = 0.0f;
  float current_current = 0.0f;
  for (uint32_t i = 0; i < homing->count; i++) {
    const float ramp = gc_max(0.0f, homing->samples[i].position - knee) - mean_ramp;
    const float current = homing->samples[i].current - mean_current;
    ramp_ramp += ramp * ramp;
    ramp_current += ramp * current;
    current_current += current * current;
  }
  return ramp_ramp > 0.0f ? current_current - ramp_current * ramp_current / ramp_ramp : current_current;
}

static void fit(gc_homing *homing, gc_motor *motors, const gc_parameters *parameters) {
  const float width = homing->high - homing->low;
  const float knee = homing->low + width * (float)homing->candidate / (float)(CANDIDATES - 1u);
  const float cost = cost_of(homing, knee);
  if (homing->cost < 0.0f || cost < homing->cost) {
    homing->cost = gc_max(cost, 0.0f);
    homing->knee = knee;
  }
  homing->candidate++;
  if (homing->candidate < CANDIDATES) {
    return;
  }
  homing->candidate = 0u;
  homing->refinements++;
  homing->low = homing->knee - width / 20.0f;
  homing->high = homing->knee + width / 20.0f;
  if (homing->refinements < REFINEMENTS) {
    return;
  }
  homing->zeros[homing->motor] = homing->knee;
  motors[homing->motor].target = homing->knee - gc_parameter_real(parameters, GC_HOMING_SLACK);
  enter(homing, GC_RELAX);
}

static void set_zeros(const gc_homing *homing, gc_motor *motors, const gc_parameters *parameters, uint8_t present) {
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    if (is_present(present, index)) {
      const float counts = homing->zeros[index] / gc_parameter_real(parameters, GC_TRAVEL_PER_COUNT);
      motors[index].zero = gc_motor_direction(parameters, index) * gc_round(counts);
      motors[index].zero_known = true;
      gc_motor_hold(&motors[index], parameters, index);
    }
  }
}

void gc_homing_start(gc_homing *homing, gc_motor *motors, const gc_parameters *parameters, uint8_t present) {
  gc_zero(homing, sizeof *homing);
  for (uint32_t index = 0; index < GC_MOTORS_MOST; index++) {
    if (is_present(present, index)) {
      motors[index].zero_known = false;
      gc_motor_hold(&motors[index], parameters, index);
      motors[index].target -= gc_parameter_real(parameters, GC_HOMING_SLACK);
    }
  }
  enter(homing, GC_SLACKEN);
}

void gc_homing_step(gc_homing *homing, gc_motor *motors, const gc_parameters *parameters, uint8_t present, float dt) {
  homing->since += dt;
  switch (homing->phase) {
    case GC_WIND:
      wind(homing, motors, parameters, dt);
      break;
    case GC_FIT:
      fit(homing, motors, parameters);
      break;
    case GC_SLACKEN:
    case GC_RELAX:
      if (arrived(motors, parameters, present)) {
        const uint32_t next = homing->phase == GC_SLACKEN ? 0u : homing->motor + 1u;
        wind_from(homing, motors, parameters, present, next);
      }
      break;
    case GC_TO_ZERO:
      if (arrived(motors, parameters, present)) {
        set_zeros(homing, motors, parameters, present);
        enter(homing, GC_HOMED);
      }
      break;
    case GC_HOMED:
    case GC_HOMING_FAILED:
      break;
    default:
      enter(homing, GC_HOMING_FAILED);
      break;
  }
  const bool running = homing->phase != GC_HOMED && homing->phase != GC_HOMING_FAILED;
  if (running && homing->since > PHASE_TIMEOUT) {
    enter(homing, GC_HOMING_FAILED);
  }
}
