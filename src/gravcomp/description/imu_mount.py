"""Mount of the IMU on the robot's base."""

import dataclasses
import functools

import numpy as np

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class ImuMount:
    """Position and orientation of imu_link in soft_base."""

    position: tuple[float, float, float] = parameter((0.0, 0.0, 0.0), edge="mm", description="origin of the IMU in soft_base")
    rpy: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), edge="deg", description="roll, pitch, yaw of imu_link in soft_base (fixed axes x, y, z)"
    )

    @functools.cached_property
    def rotation(self) -> np.ndarray:
        """(3, 3): vector in soft_base = rotation @ vector in imu_link."""
        (cr, cp, cy), (sr, sp, sy) = np.cos(self.rpy), np.sin(self.rpy)
        return np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )
