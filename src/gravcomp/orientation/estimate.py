"""Result of the orientation filter for one sample."""

from dataclasses import dataclass

import numpy as np

from gravcomp.orientation import quaternion as quat
from gravcomp.orientation.guard import Problem


@dataclass(frozen=True, slots=True)
class Estimate:
    """State of the filter after a sample; orientation and gravity are those at the stamp, the delay of the sensor compensated."""

    stamp_ns: int
    orientation: quat.Quaternion  # w x y z, sensor to earth
    gravity: quat.Vector  # m/s^2, sensor frame, pointing down
    angular_velocity: quat.Vector  # rad/s, sensor frame, without bias
    bias: quat.Vector  # rad/s
    covariance: np.ndarray  # (9, 9) of (theta, db, dv), earth / sensor / earth frame
    inclination_std: float  # rad, of the direction of gravity, the calibration of the accelerometer included
    rest: bool
    accel_norm_at_rest: float | None  # m/s^2, None before the first rest
    problem: Problem
