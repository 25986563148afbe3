// The loop on the board: a sample of the IMU to targets of the motors, without a host.
//
//     counts -> gravity -> equilibrium of the reduced model -> inverse problem -> displacements and tensions
//
// Every call does the same bounded work. Where the model has no usable equilibrium the command goes back to the
// last one, and then pays the cables out (retreat.h).
#ifndef GC_STANDALONE_LOOP_H
#define GC_STANDALONE_LOOP_H

#include "../core/frame.h"
#include "../core/imu.h"
#include "base_turn.h"
#include "controller.h"
#include "gravity.h"

#define GC_ID_JOYSTICK GC_ID_MODEL_FIRST  // x and y int16 (1 / 32767), mode uint8: 0 stored target, 1 joystick; 0; 0; check
#define GC_ID_LOOP_STATUS 0x318u          // code, model status, modes, solver's steps uint8; largest left um uint16; 0; check

// State of the loop; zeros before the first gc_standalone_take.
typedef struct {
  gc_model model;
  bool loaded;
  gc_model_status refusal;  // of the last blob
  gc_gravity_estimator gravity;
  gc_base_turn turn;
  gc_equilibrium equilibrium;
  gc_shape shape;
  gc_inverse_controller controller;
  float down[3];      // m/s^2, gravity in soft_base
  float turning[3];   // m/s^2, what turns of the base add
  bool has_gravity;
  bool has_sample;
  uint32_t time;      // us, of the last sample
  int64_t stamp;      // us, of the last sample, without the wrap
  volatile bool joystick;  // written by gc_standalone_receive, between two steps or in an interrupt
  volatile float stick[2];
} gc_standalone;

// Take a model from flash and start again with the stored target. Returns false for a blob that is refused; what was loaded
// before goes on. After the first model only those of the same robot are taken. magic and alive: of gc_model_open.
bool gc_standalone_take(gc_standalone *loop, const uint8_t *blob, size_t size, uint32_t magic, gc_alive *alive);

// Start with a model that was opened, and the stored target.
void gc_standalone_use(gc_standalone *loop, const gc_model *model);

// Let a loop that was copied to another place in memory go on with the same model, `model`, which was opened there.
void gc_standalone_moved(gc_standalone *loop, const gc_model *model);

// Estimate gravity, and what turns of the base add, from a sample: stamp in us, gyro (3,) in rad/s, accel (3,) in m/s^2. Returns
// false where it cannot be used.
bool gc_standalone_weigh(gc_standalone *loop, int64_t stamp, const float *gyro, const float *accel);

// Write the estimated gravity with what turns of the base add, (3,) in m/s^2 in soft_base.
void gc_standalone_field(const gc_standalone *loop, float *field);

// Compute the command for gravity (3,) in m/s^2 in soft_base, `interval` s after the last one; it is in loop->controller. After a
// start the model's gravity rises within half a second, and the command with it: the robot goes from where it sags to the target
// without a jump.
void gc_standalone_follow(gc_standalone *loop, const float *gravity, float interval);

// Compute targets of the motors from a sample. motors: bits of those that exist; displacement (8,) in m, positive: pulled in,
// and tension (8,) in N, both by the number of the motor less 1. Returns false while there is nothing to send: the motors hold.
bool gc_standalone_step(gc_standalone *loop, const gc_sample *sample, uint8_t motors, float *displacement, float *tension);

// Take a frame of the host: the joystick's. Returns true with the reply, the loop's status. A gc_receiver.
bool gc_standalone_receive(void *context, const gc_frame *frame, gc_frame *reply);

#endif
