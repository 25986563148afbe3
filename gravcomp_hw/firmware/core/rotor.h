// Counting of a C610's rotor: its angle wraps at 8192. The speed of the rotor gives the whole turns between two feedbacks.
#ifndef GC_ROTOR_H
#define GC_ROTOR_H

#include <stdbool.h>
#include <stdint.h>

#define GC_COUNTS_PER_TURN 8192

typedef struct {
  int32_t count;      // not wrapped
  int32_t speed;      // rpm
  int32_t current;    // mA
  uint32_t time;      // us, of the last feedback
  bool seen;          // there was a feedback, not longer ago than GC_ROTOR_FORGOTTEN
} gc_rotor;

#define GC_ROTOR_FORGOTTEN 1000000u  // us of silence after which the turns are unknown
#define GC_ROTOR_SILENT 100000u      // us of silence after which the motor is silent

// Take a feedback: angle (counts), speed (rpm), current (mA). False when no rotor can have sent it.
bool gc_rotor_update(gc_rotor *rotor, uint16_t angle, int16_t speed, int16_t current, uint32_t now);

// Forget the count after a long silence. True when it was forgotten now.
bool gc_rotor_forget(gc_rotor *rotor, uint32_t now);

// Whether the motor answers.
bool gc_rotor_answers(const gc_rotor *rotor, uint32_t now);

#endif
