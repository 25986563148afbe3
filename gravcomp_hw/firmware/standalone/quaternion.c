#include "quaternion.h"

#include "../core/maths.h"
#include "trigonometry.h"

gc_quaternion gc_quaternion_product(gc_quaternion a, gc_quaternion b) {
  return (gc_quaternion){
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
      a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
      a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
  };
}

gc_quaternion gc_quaternion_exponential(float x, float y, float z) {
  const float squared = (x * x + y * y) + z * z;
  float scale = 0.5f - squared / 48.0f, real = 1.0f - squared / 8.0f;
  if (!(squared < 1e-4f)) {
    const float angle = gc_sqrt(squared);
    gc_sin_cos(0.5f * angle, &scale, &real);
    scale /= angle;
  }
  return (gc_quaternion){real, scale * x, scale * y, scale * z};
}

gc_quaternion gc_quaternion_normalised(gc_quaternion q) {
  const float scale = 1.0f / gc_sqrt((q.w * q.w + q.x * q.x) + (q.y * q.y + q.z * q.z));
  return (gc_quaternion){q.w * scale, q.x * scale, q.y * scale, q.z * scale};
}

gc_quaternion gc_quaternion_conjugate(gc_quaternion q) { return (gc_quaternion){q.w, -q.x, -q.y, -q.z}; }

void gc_quaternion_rotate(gc_quaternion q, const float *vector, float *out) {
  const float a = vector[0], b = vector[1], c = vector[2];
  const float x = 2.0f * (q.y * c - q.z * b), y = 2.0f * (q.z * a - q.x * c), z = 2.0f * (q.x * b - q.y * a);
  out[0] = a + q.w * x + q.y * z - q.z * y;
  out[1] = b + q.w * y + q.z * x - q.x * z;
  out[2] = c + q.w * z + q.x * y - q.y * x;
}

void gc_quaternion_matrix(gc_quaternion q, float (*matrix)[3]) {
  const float w = q.w, x = q.x, y = q.y, z = q.z;
  matrix[0][0] = 1.0f - 2.0f * (y * y + z * z), matrix[0][1] = 2.0f * (x * y - z * w), matrix[0][2] = 2.0f * (x * z + y * w);
  matrix[1][0] = 2.0f * (x * y + z * w), matrix[1][1] = 1.0f - 2.0f * (x * x + z * z), matrix[1][2] = 2.0f * (y * z - x * w);
  matrix[2][0] = 2.0f * (x * z - y * w), matrix[2][1] = 2.0f * (y * z + x * w), matrix[2][2] = 1.0f - 2.0f * (x * x + y * y);
}

gc_quaternion gc_quaternion_level(const float *force, float yaw) {
  const float roll = gc_atan2(force[1], force[2]);
  const float pitch = gc_atan2(-force[0], gc_sqrt(force[1] * force[1] + force[2] * force[2]));
  float sr, cr, sp, cp, sy, cy;
  gc_sin_cos(0.5f * roll, &sr, &cr);
  gc_sin_cos(0.5f * pitch, &sp, &cp);
  gc_sin_cos(0.5f * yaw, &sy, &cy);
  return (gc_quaternion){
      cr * cp * cy + sr * sp * sy,
      sr * cp * cy - cr * sp * sy,
      cr * sp * cy + sr * cp * sy,
      cr * cp * sy - sr * sp * cy,
  };
}

float gc_quaternion_yaw(gc_quaternion q) {
  return gc_atan2(2.0f * (q.w * q.z + q.x * q.y), 1.0f - 2.0f * (q.y * q.y + q.z * q.z));
}
