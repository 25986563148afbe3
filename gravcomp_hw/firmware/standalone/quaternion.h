// Unit quaternions w x y z, Hamilton's product (src/gravcomp/orientation/quaternion.py): sensor to earth.
#ifndef GC_QUATERNION_H
#define GC_QUATERNION_H

typedef struct {
  float w, x, y, z;
} gc_quaternion;

// The rotation b, then the rotation a.
gc_quaternion gc_quaternion_product(gc_quaternion a, gc_quaternion b);

// Rotation by the rotation vector (x, y, z) in rad.
gc_quaternion gc_quaternion_exponential(float x, float y, float z);

// q / |q|.
gc_quaternion gc_quaternion_normalised(gc_quaternion q);

// The inverse rotation.
gc_quaternion gc_quaternion_conjugate(gc_quaternion q);

// Write R(q) vector (3,) into `out`, which may be `vector`.
void gc_quaternion_rotate(gc_quaternion q, const float *vector, float *out);

// Write R(q).
void gc_quaternion_matrix(gc_quaternion q, float (*matrix)[3]);

// Orientation of a sensor at rest that measures the specific force (3,) in m/s^2, with the given yaw in rad.
gc_quaternion gc_quaternion_level(const float *force, float yaw);

// Yaw of q in rad.
float gc_quaternion_yaw(gc_quaternion q);

#endif
