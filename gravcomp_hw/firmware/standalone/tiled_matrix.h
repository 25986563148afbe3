// Symmetric positive definite matrices stored by tiles (model.h): Cholesky factorisation and solution.
#ifndef GC_TILED_MATRIX_H
#define GC_TILED_MATRIX_H

#include <stdbool.h>
#include <stdint.h>

// Write the factor L, A = L L^T, of a matrix (r, r) given by tiles into `factor`: the lower triangle row by row, the
// inverses of its diagonal in their places. Returns false where A is not positive definite; `factor` is then undefined.
bool gc_factorise(const float *matrix, uint32_t r, float *factor);

// Replace the columns B (r, GC_COLUMNS) by A^-1 B. The columns of a row are handled together: the factor is read once.
#define GC_COLUMNS 4u
void gc_solve(const float *factor, uint32_t r, float (*columns)[GC_COLUMNS]);

#endif
