"""Motion of the virtual robot's base: poses over time.

World frame: z up. Inclination: angle of the robot's axis above the horizontal; 0 is horizontal, 90 deg points up, beyond that the
robot leans backwards. Gravity in `soft_base` is then g (-cos, 0, -sin) of it. Roll turns the robot about its own axis.

A motion is a function of time; `imu` returns None unless the motion contains its own IMU samples (see recorded_motion.py).
"""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.virtual.se3 import rotation_exp, rotation_log, rotation_to_quaternion

_OTHER_WAVES = [2, 0, 1]  # of a hand's turns about x, y, z: those with which it shifts along these axes


class BaseMotion(Protocol):
    """Pose of the base over time. The times of successive calls do not decrease."""

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""

    def imu(self, time: float, period: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Return angular rate (3,) rad/s and specific force (3,) m/s^2 in imu_link, means over the `period` s before `time` s.

        None means that they follow from the poses.
        """


class SyntheticMotion:
    """A motion whose IMU samples follow from its poses."""

    def imu(self, time: float, period: float) -> None:
        """Return None: the samples follow from the poses."""
        return None


class StaticMotion(SyntheticMotion):
    """The base is at rest."""

    def __init__(self, orientation: np.ndarray):
        self._orientation = orientation

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""
        return self._orientation, np.zeros(3)


class WaypointMotion(SyntheticMotion):
    """Turns from orientation to orientation along minimum-jerk polynomials, with a time at rest at each.

    stops: (orientation (3, 3), time at rest in s); rate: mean angular speed of the turns in rad/s; repeat: begin again after the
    last stop.
    """

    def __init__(self, stops: Sequence[tuple[np.ndarray, float]], rate: float, repeat: bool = False):
        self._orientations = [orientation for orientation, _ in stops]
        self._legs = []  # (start of rest, start of turn, end of turn, rotation vector)
        time = 0.0
        for index, (orientation, resting) in enumerate(stops):
            last = index + 1 == len(stops)
            following = self._orientations[0 if last else index + 1]
            turn = rotation_vector_between(orientation, following) if not last or repeat else np.zeros(3)
            end = time + resting + float(np.linalg.norm(turn)) / rate
            self._legs.append((time, time + resting, end, turn))
            time = end
        self.duration = time
        self._repeat = repeat

    @property
    def rests(self) -> list[tuple[float, float]]:
        """Begin and end of the time at rest at each stop in s, of the first time through."""
        return [(begin, end) for begin, end, _, _ in self._legs]

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""
        time = time % self.duration if self._repeat else min(time, self.duration)
        index = max(i for i, leg in enumerate(self._legs) if leg[0] <= time or i == 0)
        _, start, end, turn = self._legs[index]
        s = min(1.0, max(0.0, (time - start) / (end - start))) if end > start else 0.0
        smooth = s**3 * (10 - 15 * s + 6 * s**2)
        return self._orientations[index] @ turned(smooth * turn), np.zeros(3)


class RotationMotion(SyntheticMotion):
    """A rotation at `rate` rad/s about an axis (3,) that is fixed in the frame of the base, after `hold` s at rest."""

    def __init__(self, orientation: np.ndarray, axis: np.ndarray, rate: float, hold: float):
        self._orientation, self._axis, self._rate, self._hold = orientation, axis, rate, hold

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""
        return self._orientation @ turned(self._axis * self._rate * max(0.0, time - self._hold)), np.zeros(3)


class TremorMotion(SyntheticMotion):
    """A hand: slow drift and physiological tremor.

    Slow: 0.1 to 0.6 Hz, a few degrees. Tremor: 8 to 12 Hz, tenths of a degree and of a millimetre.
    Amplitudes: R. N. Stiles, "Frequency and displacement amplitude relations for normal hand tremor", J. Appl. Physiol. 40, 1976.
    """

    def __init__(self, orientation: np.ndarray, seed: int, drift: bool = True):
        """Begin at `orientation` (3, 3), world from soft_base; drift: with the slow part."""
        random = np.random.default_rng(seed)
        self._orientation = orientation
        self._frequency = np.concatenate([random.uniform(0.1, 0.6, (3, 3)), random.uniform(8.0, 12.0, (3, 3))], axis=1)
        self._phase = random.uniform(0.0, 2 * math.pi, (3, 6))
        self._turn = np.radians([1.5, 1.0, 0.7, 0.10, 0.08, 0.06])
        self._shift = np.array([3.0, 2.0, 1.0, 0.10, 0.08, 0.06]) * 1e-3
        if not drift:
            self._turn[:3] = self._shift[:3] = 0.0

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""
        # The hand starts from rest, so that the first samples are those of a base at rest.
        begin = min(1.0, time / 2.0) ** 2
        waves = np.sin(2 * math.pi * self._frequency * time + self._phase)
        return self._orientation @ turned(begin * (waves @ self._turn)), begin * (waves[_OTHER_WAVES] @ self._shift)


class FollowedMotion(SyntheticMotion):
    """Follows orientations from outside, critically damped and with a limited angular speed.

    It begins at rest at the pose `orientation` (3, 3), `position` (3,) m, at `time` s. time_constant: of the second-order lag, s;
    speed_limit: rad/s.
    """

    def __init__(
        self,
        orientation: np.ndarray,
        position: np.ndarray | None = None,
        time: float = 0.0,
        time_constant: float = 0.05,
        speed_limit: float = math.radians(360.0),
    ):
        self._orientation, self._target = orientation.copy(), orientation.copy()
        self._position = np.zeros(3) if position is None else position.copy()
        self._rate, self._time = np.zeros(3), time
        self._time_constant, self._speed_limit = time_constant, speed_limit

    def follow(self, orientation: np.ndarray) -> None:
        """Set the orientation (3, 3), world from soft_base, to turn to."""
        self._target = orientation

    def coast(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the pose at `time` s after a turn at constant angular velocity; the target does not count in that time."""
        self._orientation = self._orientation @ turned(self._rate * (time - self._time))
        self._time = time
        return self._orientation, self._position

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""
        steps = max(1, math.ceil((time - self._time) / (0.1 * self._time_constant)))
        dt = (time - self._time) / steps
        self._time = time
        for _ in range(steps if dt > 0 else 0):
            error = rotation_vector_between(self._orientation, self._target)
            # Implicit in the rate: stable for any step.
            gain = dt / self._time_constant
            self._rate = (self._rate + gain * error / self._time_constant) / (1 + 2 * gain + gain**2)
            self._rate *= min(1.0, self._speed_limit / (float(np.linalg.norm(self._rate)) + 1e-12))
            self._orientation = self._orientation @ turned(self._rate * dt)
        return self._orientation, self._position


def tilting(hold: float, rate: float) -> WaypointMotion:
    """Return a motion that is horizontal for `hold` s (sag, compensation), then tilts and rolls at `rate` rad/s and returns."""
    stops = [(0, 0), (30, 0), (30, 90), (-30, 90), (-45, 0), (0, -60), (45, 0), (0, 0)]
    return WaypointMotion(
        [(base_orientation(math.radians(i), math.radians(r)), 3.0 if k else hold) for k, (i, r) in enumerate(stops)], rate
    )


def arm_poses(hold: float, rate: float) -> WaypointMotion:
    """Return a motion through the article's five inclinations, 135, 90, 45, 0, -45 deg, and back, at `rate` rad/s."""
    inclinations = [135, 90, 45, 0, -45, 0, 45, 90, 135]
    return WaypointMotion(
        [(base_orientation(math.radians(i)), hold if k == 0 else 10.0) for k, i in enumerate(inclinations)], rate
    )


def base_orientation(inclination: float, roll: float = 0.0) -> np.ndarray:
    """Return the rotation (3, 3), world from soft_base, of an inclination and a roll in rad."""
    c, s = math.cos(inclination), math.sin(inclination)
    horizontal = np.array([[-s, 0.0, c], [0.0, -1.0, 0.0], [c, 0.0, s]])
    return horizontal @ turned(np.array([0.0, 0.0, roll]))


def turned(rotation_vector: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a rotation vector (3,) in rad."""
    result = np.empty((3, 3))
    rotation_exp(np.asarray(rotation_vector, float), result)
    return result


def rotation_vector_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3,) in rad from the rotation a (3, 3) to b (3, 3), in the frame of a."""
    result = np.empty(3)
    rotation_log(np.ascontiguousarray(a.T @ b), result)
    return result


def rotation_from_quaternion(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Return the rotation (3, 3) of a quaternion of any length.

    Raises ValueError for length zero and for values that are not finite.
    """
    norm = x * x + y * y + z * z + w * w
    if not math.isfinite(norm) or norm < 1e-12:
        raise ValueError(
            f"({x}, {y}, {z}, {w}) is not a quaternion of a rotation; finite values that are not all zero are needed"
        )
    return Rotation.from_quat((x, y, z, w)).as_matrix()


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,) x y z w of a rotation (3, 3), w >= 0."""
    result = np.empty(4)
    rotation_to_quaternion(np.ascontiguousarray(rotation, dtype=float), result)
    return result
