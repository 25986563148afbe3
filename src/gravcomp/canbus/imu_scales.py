"""Scales of all known IMUs, from the board's counts to SI, by the range codes in BoardStatus.

To add an IMU: a file with its scales by range code, as `bmi088`, with codes that no other IMU has, and an entry in `_CHIPS`.
"""

from gravcomp.canbus import bmi088

_CHIPS = (bmi088,)
_ACCELEROMETER = {code: scale for chip in _CHIPS for code, scale in chip.ACCELEROMETER_SCALES.items()}
_GYROSCOPE = {code: scale for chip in _CHIPS for code, scale in chip.GYROSCOPE_SCALES.items()}


def accelerometer_scale(code: int) -> float:
    """Return m/s^2 per count. Raises KeyError for an unknown code."""
    return _ACCELEROMETER[code]


def gyroscope_scale(code: int) -> float:
    """Return rad/s per count. Raises KeyError for an unknown code."""
    return _GYROSCOPE[code]


def known_ranges(accelerometer: int, gyroscope: int) -> bool:
    """Return whether both range codes are those of a known IMU."""
    return accelerometer in _ACCELEROMETER and gyroscope in _GYROSCOPE
