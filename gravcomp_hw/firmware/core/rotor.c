#include "rotor.h"

#include "maths.h"

#define SPEED_LIMIT 20000                // rpm; more than the motor reaches
#define FARTHEST 0x20000000              // counts; a rotor that has turned farther is not that of a cable
#define COUNTS_PER_US_AND_RPM 1.365333333e-4f  // 8192 / 60e6

static int32_t wrapped(int32_t counts) {
  const int32_t half = GC_COUNTS_PER_TURN / 2;
  int32_t rest = (counts + half) % GC_COUNTS_PER_TURN;
  if (rest < 0) {
    rest += GC_COUNTS_PER_TURN;
  }
  return rest - half;
}

bool gc_rotor_update(gc_rotor *rotor, uint16_t angle, int16_t speed, int16_t current, uint32_t now) {
  if (angle >= (uint16_t)GC_COUNTS_PER_TURN || speed > SPEED_LIMIT || speed < -SPEED_LIMIT) {
    return false;
  }
  (void)gc_rotor_forget(rotor, now);
  if (!rotor->seen) {
    rotor->count = (int32_t)angle;
    rotor->seen = true;
  } else {
    // The rotor turned at the mean of both speeds; the angle corrects that to the nearest count.
    const float elapsed = (float)(now - rotor->time);
    const float mean = 0.5f * (float)(rotor->speed + speed);
    const int32_t predicted = gc_round(mean * elapsed * COUNTS_PER_US_AND_RPM);
    rotor->count += predicted + wrapped((int32_t)angle - rotor->count - predicted);
    if (rotor->count > FARTHEST || rotor->count < -FARTHEST) {
      rotor->seen = false;
    }
  }
  rotor->speed = speed;
  rotor->current = current;
  rotor->time = now;
  return true;
}

bool gc_rotor_forget(gc_rotor *rotor, uint32_t now) {
  if (rotor->seen && now - rotor->time > GC_ROTOR_FORGOTTEN) {
    rotor->seen = false;
    return true;
  }
  return false;
}

bool gc_rotor_answers(const gc_rotor *rotor, uint32_t now) {
  return rotor->seen && now - rotor->time <= GC_ROTOR_SILENT;
}
