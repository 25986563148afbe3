"""Scales of the Bosch BMI088 [BMI088 data sheet]: from counts to SI, by the range codes in BoardStatus.

specific force [m/s^2] = counts / (LSB per g) x 9.80665        angular rate [rad/s] = counts x range / 32767
"""

import math

from gravcomp.standard_gravity import STANDARD_GRAVITY

_LSB_PER_G = {0: 10920.0, 1: 5460.0, 2: 2730.0, 3: 1365.0}  # 3, 6, 12, 24 g
_RANGE_DEG_S = {0: 2000, 1: 1000, 2: 500, 3: 250, 4: 125}

ACCELEROMETER_SCALES = {code: STANDARD_GRAVITY / counts for code, counts in _LSB_PER_G.items()}
"""m/s^2 per count by range code."""

GYROSCOPE_SCALES = {code: math.radians(full) / 32767.0 for code, full in _RANGE_DEG_S.items()}
"""rad/s per count by range code."""
