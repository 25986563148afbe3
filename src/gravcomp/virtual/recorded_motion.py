"""The base turns as a recording's ground truth did, and the board sends what the recording's IMU measured.

The samples between two of the board's own are averaged over exactly that time by their integral, so that the turned angle is kept
whatever the two rates are. Gaps in the ground truth and samples that are not finite are bridged by interpolation.
"""

import numpy as np

from gravcomp.recordings.imu import Recording, RecordingError
from gravcomp.virtual.motion import rotation_from_quaternion, turned
from gravcomp.virtual.se3 import rotation_log


class RecordedMotion:
    """Plays `recording` from `start` (s) on; mount (3, 3) turns imu_link's vectors into soft_base. Beyond its end the base
    stands still.

    Raises RecordingError for a recording without ground truth.
    """

    def __init__(self, recording: Recording, mount: np.ndarray, start: float = 0.0):
        if recording.orientation is None:
            raise RecordingError(f"{recording.source}: has no ground truth of the orientation; the base cannot turn as it did")
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
        w, x, y, z = recording.orientation[known].T
        self._orientation = np.array([rotation_from_quaternion(*q) for q in zip(x, y, z, w)]) @ mount.T
        self._rate_integral = _integral(self._time, recording.gyro)
        self._force_integral = _integral(self._time, recording.accel)
        self.duration = float(self._time[-1])

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3), world from soft_base, interpolated along the shortest way; position 0."""
        k = int(np.searchsorted(self._known_time, time, side="right"))
        if k == 0 or k == len(self._known_time):
            return self._orientation[min(k, len(self._orientation) - 1)], np.zeros(3)
        before, after = self._orientation[k - 1], self._orientation[k]
        part = (time - self._known_time[k - 1]) / (self._known_time[k] - self._known_time[k - 1])
        turn = np.empty(3)
        rotation_log(np.ascontiguousarray(before.T @ after), turn)
        return before @ turned(part * turn), np.zeros(3)

    def imu(self, time: float, period: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Mean angular rate and specific force over the `period` before `time`, in imu_link; None outside the recording."""
        if time - period < 0.0 or time > self.duration:
            return None
        return tuple(
            np.array([np.interp(time, self._time, c) - np.interp(time - period, self._time, c) for c in integral]) / period
            for integral in (self._rate_integral, self._force_integral)
        )


def _integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(3, n) integral of values (n, 3), each held over the time before its stamp."""
    columns = []
    for column in values.T.astype(float):
        finite = np.isfinite(column)
        column = np.interp(time, time[finite], column[finite])
        columns.append(np.concatenate([[0.0], np.cumsum(column[1:] * np.diff(time))]))
    return np.array(columns)
