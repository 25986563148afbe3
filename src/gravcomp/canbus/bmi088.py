"""Scales of the Bosch BMI088 [BMI088 data sheet]: from counts to SI, by the range codes in BoardStatus.

specific force [m/s^2] = counts / (LSB per g) x 9.80665        angular rate [rad/s] = counts x range / 32767
"""

import math

STANDARD_GRAVITY = 9.80665

ACCELEROMETER_RANGE_G = (3, 6, 12, 24)
_LSB_PER_G = (10920.0, 5460.0, 2730.0, 1365.0)

GYROSCOPE_RANGE_DEG_S = (2000, 1000, 500, 250, 125)


def accelerometer_scale(code: int) -> float:
    """Return m/s^2 per count for the range code 0 to 3."""
    return STANDARD_GRAVITY / _LSB_PER_G[code]


def gyroscope_scale(code: int) -> float:
    """Return rad/s per count for the range code 0 to 4."""
    return math.radians(GYROSCOPE_RANGE_DEG_S[code]) / 32767.0
