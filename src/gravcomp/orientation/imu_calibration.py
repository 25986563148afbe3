"""Correction of the IMU's samples that the estimator applies; orientation/calibration.py fits it."""

from dataclasses import dataclass

from gravcomp.config import parameter


@dataclass(frozen=True)
class ImuCalibration:
    """corrected specific force = accel_scale (a - accel_offset), corrected rate = rate - gyro_offset."""

    accel_scale: tuple[float, float, float] = parameter(
        (1.0, 1.0, 1.0), minimum=0.5, maximum=2, description="accelerometer scale, by axis"
    )
    accel_offset: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), unit="m/s^2", minimum=-5, maximum=5, description="accelerometer offset, by axis"
    )
    gyro_offset: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), edge="deg/s", minimum=-20, maximum=20, description="gyroscope offset, by axis"
    )
    norm_tolerance: float = parameter(
        0.3,
        unit="m/s^2",
        minimum=0.01,
        maximum=5,
        description="|a| at rest that differs more from gravity: calibration is needed",
    )
