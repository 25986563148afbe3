"""Inclination error on a recording with ground truth."""

import numpy as np

from gravcomp.orientation.inclination import inclination_rmse
from gravcomp.recordings.imu import Recording


def rmse_deg(orientation: np.ndarray, recording: Recording) -> float:
    """Return the RMSE of the inclination in deg over the moving part; orientation: (n, 4), w x y z, estimated."""
    assert recording.orientation is not None  # the benchmark's trials have ground truth
    return round(float(np.degrees(inclination_rmse(orientation, recording.orientation, recording.movement))), 4)
