// The two inner loops in which the loop on the board spends half of its time, over the columns of a tile of four rows.
//
// On the Cortex-M4 they are written in its instructions: compilers neither load several registers at once nor keep two dependent
// operations apart, for which the processor waits. They do the same operations in the same order as the loops in C, so that a host
// and the board agree bit for bit.
#ifndef GC_KERNELS_H
#define GC_KERNELS_H

#include "model.h"

#if defined(__arm__) && defined(__ARM_ARCH_7EM__)
#define GC_ARM_KERNELS 1
#endif

#ifdef GC_ARM_KERNELS

#define GC_PRODUCT_ROW(row, q)                                                                                      \
  "vldmia %[b]!, {s24-s27}\n"                                                                                       \
  "vmul.f32 s29, s24, s28\n vmul.f32 s30, s25, s28\n vadd.f32 " row(0) ", " row(0) ", s29\n"                        \
  "vmul.f32 s31, s26, s28\n vadd.f32 " row(1) ", " row(1) ", s30\n vmul.f32 s29, s27, s28\n"                        \
  "vadd.f32 " row(2) ", " row(2) ", s31\n vmul.f32 s24, s24, " q "\n vadd.f32 " row(3) ", " row(3) ", s29\n"        \
  "vmul.f32 s25, s25, " q "\n vadd.f32 s20, s20, s24\n vmul.f32 s26, s26, " q "\n vadd.f32 s21, s21, s25\n"         \
  "vmul.f32 s27, s27, " q "\n vadd.f32 s22, s22, s26\n vadd.f32 s23, s23, s27\n"
#define GC_R0(k) GC_NAME_(k, 0, 1, 2, 3)
#define GC_R1(k) GC_NAME_(k, 4, 5, 6, 7)
#define GC_R2(k) GC_NAME_(k, 8, 9, 10, 11)
#define GC_R3(k) GC_NAME_(k, 12, 13, 14, 15)
#define GC_NAME_(k, a, b, c, d) GC_PICK_##k(a, b, c, d)
#define GC_PICK_0(a, b, c, d) "s" #a
#define GC_PICK_1(a, b, c, d) "s" #b
#define GC_PICK_2(a, b, c, d) "s" #c
#define GC_PICK_3(a, b, c, d) "s" #d

// Add B q_j of `count` columns to four rows (4, 4), and B^T (q_0 to q_3) to the columns (count, 4). b: 16 floats a column.
static inline void gc_tile_products(const float *b, const float *q, const float *q_rows, uint32_t count,
                                    float (*columns)[GC_TILE], float (*rows)[GC_TILE]) {
  if (count == 0u) {
    return;
  }
  float *to = columns[0];
  __asm__ volatile(
      "vldmia %[rows], {s0-s15}\n"
      "vldmia %[own], {s16-s19}\n"
      "1:\n"
      "vldmia %[q]!, {s28}\n"
      "vldmia %[to], {s20-s23}\n"
      GC_PRODUCT_ROW(GC_R0, "s16") GC_PRODUCT_ROW(GC_R1, "s17") GC_PRODUCT_ROW(GC_R2, "s18") GC_PRODUCT_ROW(GC_R3, "s19")
      "subs %[count], %[count], #1\n"
      "vstmia %[to]!, {s20-s23}\n"
      "bne 1b\n"
      "vstmia %[rows], {s0-s15}\n"
      : [b] "+r"(b), [q] "+r"(q), [to] "+r"(to), [count] "+r"(count)
      : [rows] "r"(rows[0]), [own] "r"(q_rows)
      : "cc", "memory", "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14", "s15",
        "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23", "s24", "s25", "s26", "s27", "s28", "s29", "s30", "s31");
}

#define GC_STIFFNESS_ROW(row, place)                                                                                \
  "vldmia %[b]!, {s24-s27}\n"                                                                                       \
  "vldr s30, [%[to], #" place "]\n"                                                                                 \
  "vmul.f32 s28, s20, " row(0) "\n vmul.f32 s29, s21, " row(1) "\n vadd.f32 s30, s30, s28\n"                        \
  "vmul.f32 s28, s22, " row(2) "\n vadd.f32 s30, s30, s29\n vmul.f32 s29, s23, " row(3) "\n vadd.f32 s30, s30, s28\n" \
  "vmul.f32 s28, s16, s24\n vadd.f32 s30, s30, s29\n vmul.f32 s29, s17, s25\n vadd.f32 s30, s30, s28\n"             \
  "vmul.f32 s28, s18, s26\n vadd.f32 s30, s30, s29\n vmul.f32 s29, s19, s27\n vadd.f32 s30, s30, s28\n"             \
  "vadd.f32 s30, s30, s29\n"                                                                                        \
  "vstr s30, [%[to], #" place "]\n"

// Add rows . columns + strain . B of `count` columns (count, 4) and four rows (4, 4) to a tile of the stiffness (count, 4).
static inline void gc_tile_stiffness(const float *b, const float (*rows)[GC_TILE], const float (*columns)[GC_TILE],
                                     const float *strain, uint32_t count, float *to) {
  if (count == 0u) {
    return;
  }
  const float *column = columns[0];
  __asm__ volatile(
      "vldmia %[rows], {s0-s15}\n"
      "vldmia %[strain], {s16-s19}\n"
      "1:\n"
      "vldmia %[column]!, {s20-s23}\n"
      GC_STIFFNESS_ROW(GC_R0, "0") GC_STIFFNESS_ROW(GC_R1, "4") GC_STIFFNESS_ROW(GC_R2, "8") GC_STIFFNESS_ROW(GC_R3, "12")
      "subs %[count], %[count], #1\n"
      "add %[to], %[to], #16\n"
      "bne 1b\n"
      : [b] "+r"(b), [column] "+r"(column), [to] "+r"(to), [count] "+r"(count)
      : [rows] "r"(rows[0]), [strain] "r"(strain)
      : "cc", "memory", "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13", "s14", "s15",
        "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23", "s24", "s25", "s26", "s27", "s28", "s29", "s30");
}

#else

// As above.
static inline void gc_tile_products(const float *b, const float *q, const float *q_rows, uint32_t count,
                                    float (*columns)[GC_TILE], float (*rows)[GC_TILE]) {
  for (uint32_t j = 0; j < count; ++j) {
    for (uint32_t a = 0; a < GC_TILE; ++a, b += GC_TILE) {
      for (uint32_t k = 0; k < GC_TILE; ++k) {
        rows[a][k] += b[k] * q[j];
        columns[j][k] += b[k] * q_rows[a];
      }
    }
  }
}

static inline void gc_tile_stiffness(const float *b, const float (*rows)[GC_TILE], const float (*columns)[GC_TILE],
                                     const float *strain, uint32_t count, float *to) {
  for (uint32_t j = 0; j < count; ++j, to += GC_TILE) {
    for (uint32_t a = 0; a < GC_TILE; ++a, b += GC_TILE) {
      for (uint32_t k = 0; k < GC_TILE; ++k) {
        to[a] += columns[j][k] * rows[a][k];
      }
      for (uint32_t k = 0; k < GC_TILE; ++k) {
        to[a] += strain[k] * b[k];
      }
    }
  }
}

#endif

#endif
