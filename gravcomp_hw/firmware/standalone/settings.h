// Settings of the standalone loop that come from the robot's YAML file, as floats in SI units, in the order of the blob.
//
// src/gravcomp/firmware/model_settings.py writes the same names in the same order.
#ifndef GC_SETTINGS_H
#define GC_SETTINGS_H

typedef struct {
  float length;              // m
  float reach;               // largest |q|
  float period;              // s between two samples
  // limits of the cables
  float tension_max;         // N
  float tension_rate;        // N/s
  float displacement_min;    // m
  float displacement_max;    // m
  float displacement_rate;   // m/s
  // inverse problem
  float axial_weight;
  float energy_weight;
  float proximal_weight;
  float slack;               // m
  float tolerance;           // m
  float tilt_tolerance;      // rad
  // stored target, and the joystick's
  float target_tip[3];       // m
  float target_direction[3]; // unit vector, zeros: free
  float tip_weight;
  float direction_weight;    // m^2
  float joystick_bend;       // rad at full deflection
  // IMU
  float mount[4];            // w x y z, IMU to soft_base
  float accel_scale[3];
  float accel_offset[3];     // m/s^2
  float gyro_offset[3];      // rad/s
  float horizon;             // s of the prediction
  float trend_time;          // s
  float longest_trend;       // s
  // orientation filter
  float gravity;             // m/s^2
  float gyro_noise;
  float gyro_noise_per_rate;
  float accel_noise;
  float bias_walk;
  float bias_walk_stable;
  float bias_initial;        // rad/s
  float velocity_noise;
  float rest_noise;
  float bias_estimation;     // 1: on
  float rest_time_constant;  // s
  float rest_gyro_deviation;
  float rest_accel_deviation;
  float rest_accel_drift;
  float rest_minimum_time;   // s
  float rest_largest_bias;   // rad/s
  float gyro_range;          // rad/s
  float accel_range;         // m/s^2
  float delay;               // s
  float stuck_time;          // s
  float largest_gap;         // s
  float spike_gyro;          // rad/s
  float spike_accel;         // m/s^2
  float spike_ratio;
  float spike_time_constant; // s
  float spike_longest;       // samples
  float turn_height;         // m along the robot: where the forces of a turning base are taken; 0: they do not count
  float turn_time;           // s, low-pass of the base's rate
  float law_share;           // points of a law of which a step computes the stiffness
  float cable_motor[9];      // number of each cable's motor, 1 to 8; 0: no such cable
} gc_settings;

#endif
