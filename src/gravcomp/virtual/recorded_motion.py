"""Motion of the base from a recording: poses from its ground truth, IMU samples from its IMU.

The samples of the recording are averaged over each sample period of the board by means of their integral, so the total angle is
exact at any two rates. Gaps in the ground truth and samples that are not finite are interpolated.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.recordings.imu import Recording, RecordingError
from gravcomp.virtual.motion import rotation_vector_between, turned


class RecordedMotion:
    """Plays `recording` from `start` (s) on; beyond its end the base is at rest."""

    def __init__(self, recording: Recording, mount: np.ndarray, start: float = 0.0):
        """mount (3, 3): soft_base from imu_link.

        Raises RecordingError for a recording without ground truth, or not longer than `start`.
        """
        if recording.orientation is None:
            raise RecordingError(
                f"{recording.source}: has no ground truth of the orientation, which the motion of the base needs"
            )
        self._time = (recording.stamp_ns - recording.stamp_ns[0]) * 1e-9 - start
        if self._time[-1] <= 0.0:
            raise RecordingError(
                f"{recording.source}: lasts {self._time[-1] + start:.1f} s; it cannot be played from {start:g} s on"
            )
        known = np.isfinite(recording.orientation).all(axis=1)
        if known.sum() < 2:
            raise RecordingError(
                f"{recording.source}: the ground truth has {known.sum()} known orientations; at least 2 are needed"
            )
        self._known_time = self._time[known]
        self._orientation = Rotation.from_quat(recording.orientation[known], scalar_first=True).as_matrix() @ mount.T
        self._rate_integral = _integral(self._time, recording.gyro)
        self._force_integral = _integral(self._time, recording.accel)
        self.duration = float(self._time[-1])

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, interpolated along the shortest arc, and position 0, at `time` s."""
        k = int(np.searchsorted(self._known_time, time, side="right"))
        if k == 0 or k == len(self._known_time):
            return self._orientation[min(k, len(self._orientation) - 1)], np.zeros(3)
        before, after = self._orientation[k - 1], self._orientation[k]
        part = (time - self._known_time[k - 1]) / (self._known_time[k] - self._known_time[k - 1])
        return before @ turned(part * rotation_vector_between(before, after)), np.zeros(3)

    def imu(self, time: float, period: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Return mean angular rate and specific force over the `period` s before `time` s, in imu_link.

        Outside the recording: None.
        """
        if time - period < 0.0 or time > self.duration:
            return None
        return self._mean(self._rate_integral, time, period), self._mean(self._force_integral, time, period)

    def _mean(self, integral: np.ndarray, time: float, period: float) -> np.ndarray:
        return np.array([np.interp(time, self._time, c) - np.interp(time - period, self._time, c) for c in integral]) / period


def _integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the integral (3, n) of values (n, 3) over time (n,) s; a value counts for the time before its stamp."""
    columns = []
    for column in values.T.astype(float):
        finite = np.isfinite(column)
        column = np.interp(time, time[finite], column[finite])
        columns.append(np.concatenate([[0.0], np.cumsum(column[1:] * np.diff(time))]))
    return np.array(columns)
