"""Products of one row with many, as they build a stiffness row by row."""

import numpy as np
from numba import njit

from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def add_row_products(row: np.ndarray, rows: np.ndarray, count: int, line: np.ndarray) -> None:
    """Add the products of `row` (k,) with the first `count` of `rows` (r, k) to `line` (r,); row and rows in single precision."""
    j = 0
    while j + 4 <= count:  # four at a time: the row is read less often
        r_0, r_1, r_2, r_3 = rows[j], rows[j + 1], rows[j + 2], rows[j + 3]
        k_0 = k_1 = k_2 = k_3 = np.float32(0.0)
        for k in range(len(row)):
            x = row[k]
            k_0 += x * r_0[k]
            k_1 += x * r_1[k]
            k_2 += x * r_2[k]
            k_3 += x * r_3[k]
        line[j] += k_0
        line[j + 1] += k_1
        line[j + 2] += k_2
        line[j + 3] += k_3
        j += 4
    while j < count:
        r_0, k_0 = rows[j], np.float32(0.0)
        for k in range(len(row)):
            k_0 += row[k] * r_0[k]
        line[j] += k_0
        j += 1
