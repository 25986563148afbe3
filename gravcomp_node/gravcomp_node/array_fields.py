"""Values for the array fields of messages."""

from array import array

import numpy as np


def doubles(values: np.ndarray) -> array:
    """Return values for a float64[] field, which takes an array.array 100 times faster than a list, as it checks no elements."""
    result = array("d")
    result.frombytes(np.ascontiguousarray(values, dtype=np.float64).tobytes())
    return result
