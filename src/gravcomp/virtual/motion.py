"""How the base of the virtual robot is carried about: poses over time.

World frame: z up. Inclination: angle of the robot's axis above the horizontal, 0 horizontal, 90 deg pointing up, beyond that
leaning over backwards; gravity in `soft_base` is then g (-cos, 0, -sin) of it. Roll turns the robot about its own axis.

A motion is a function of time; `imu` is None unless the motion brings its own IMU samples along (see recorded_motion.py).
"""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from gravcomp.virtual.se3 import rotation_exp, rotation_log, rotation_to_quaternion


class BaseMotion(Protocol):
    """Where the base is. Times do not go back from call to call."""

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3), world from soft_base, and position (3,) m at `time` s."""

    def imu(self, time: float, period: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Angular rate (3,) rad/s and specific force (3,) m/s^2 over the `period` before `time`, or None: to be derived from
        the pose.
        """


class SyntheticMotion:
    """A motion whose IMU samples follow from its poses."""

    def imu(self, time: float, period: float) -> None:
        return None


class StaticMotion(SyntheticMotion):
    """The base stands still."""

    def __init__(self, orientation: np.ndarray):
        self._orientation = orientation

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        return self._orientation, np.zeros(3)


class WaypointMotion(SyntheticMotion):
    """From orientation to orientation, standing still at each; each turn with the smoothness of the minimum-jerk polynomial.

    stops: (orientation (3, 3), time of standing s); rate: mean angular speed of the turns in rad/s.
    """

    def __init__(self, stops: Sequence[tuple[np.ndarray, float]], rate: float, repeat: bool = False):
        self._orientations = [orientation for orientation, _ in stops]
        self._legs = []  # (start of standing, start of turn, end of turn, rotation vector)
        time = 0.0
        for index, (orientation, standing) in enumerate(stops):
            last = index + 1 == len(stops)
            following = self._orientations[0 if last else index + 1]
            turn = _relative(orientation, following) if not last or repeat else np.zeros(3)
            end = time + standing + float(np.linalg.norm(turn)) / rate
            self._legs.append((time, time + standing, end, turn))
            time = end
        self.duration = time
        self._repeat = repeat

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        time = time % self.duration if self._repeat else min(time, self.duration)
        index = max(i for i, leg in enumerate(self._legs) if leg[0] <= time or i == 0)
        _, start, end, turn = self._legs[index]
        s = min(1.0, max(0.0, (time - start) / (end - start))) if end > start else 0.0
        smooth = s**3 * (10 - 15 * s + 6 * s**2)
        return self._orientations[index] @ turned(smooth * turn), np.zeros(3)


class RotationMotion(SyntheticMotion):
    """A steady rotation about an axis (3,) fixed in the base's frame, after standing still for `hold` s."""

    def __init__(self, orientation: np.ndarray, axis: np.ndarray, rate: float, hold: float):
        self._orientation, self._axis, self._rate, self._hold = orientation, axis, rate, hold

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        return self._orientation @ turned(self._axis * self._rate * max(0.0, time - self._hold)), np.zeros(3)


class TremorMotion(SyntheticMotion):
    """A hand: slow wandering (0.1 to 0.6 Hz, a few degrees) and physiological tremor (8 to 12 Hz, tenths of a degree and of a
    millimetre).

    Amplitudes: R. N. Stiles, "Frequency and displacement amplitude relations for normal hand tremor", J. Appl. Physiol. 40, 1976.
    """

    def __init__(self, orientation: np.ndarray, seed: int):
        random = np.random.default_rng(seed)
        self._orientation = orientation
        self._frequency = np.concatenate([random.uniform(0.1, 0.6, (3, 3)), random.uniform(8.0, 12.0, (3, 3))], axis=1)
        self._phase = random.uniform(0.0, 2 * math.pi, (3, 6))
        self._turn = np.radians([1.5, 1.0, 0.7, 0.10, 0.08, 0.06])
        self._shift = np.array([3.0, 2.0, 1.0, 0.10, 0.08, 0.06]) * 1e-3

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        # The hand starts from rest, so that the first samples are those of a base that stands still.
        begin = min(1.0, time / 2.0) ** 2
        waves = np.sin(2 * math.pi * self._frequency * time + self._phase)
        return self._orientation @ turned(begin * (waves @ self._turn)), begin * (np.roll(waves, 1, axis=0) @ self._shift)


class FollowedMotion(SyntheticMotion):
    """Follows orientations that come from outside, as a carried mass would: critically damped, with bounded angular speed.

    It begins at rest at the pose `orientation` (3, 3), `position` (3,) m, at `time` s.
    time_constant: s of the second-order lag; speed_limit: rad/s.
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
        """Set where to turn to, (3, 3)."""
        self._target = orientation

    def coast(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """The pose at `time`, turned on at the pace it had: whoever steers went on while nobody looked."""
        self._orientation = self._orientation @ turned(self._rate * (time - self._time))
        self._time = time
        return self._orientation, self._position

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        steps = max(1, math.ceil((time - self._time) / (0.1 * self._time_constant)))
        dt = (time - self._time) / steps
        self._time = time
        for _ in range(steps if dt > 0 else 0):
            error = _relative(self._orientation, self._target)
            # Implicit in the rate: stable for any step.
            gain = dt / self._time_constant
            self._rate = (self._rate + gain * error / self._time_constant) / (1 + 2 * gain + gain**2)
            self._rate *= min(1.0, self._speed_limit / (float(np.linalg.norm(self._rate)) + 1e-12))
            self._orientation = self._orientation @ turned(self._rate * dt)
        return self._orientation, self._position


def tilting(hold: float, rate: float) -> WaypointMotion:
    """Horizontal for `hold` s (to sag and to compensate), then through tilts and rolls and back, again and again."""
    stops = [(0, 0), (30, 0), (30, 90), (-30, 90), (-45, 0), (0, -60), (45, 0), (0, 0)]
    return WaypointMotion(
        [(base_orientation(math.radians(i), math.radians(r)), 3.0 if k else hold) for k, (i, r) in enumerate(stops)], rate
    )


def arm_poses(hold: float, rate: float) -> WaypointMotion:
    """The article's five directions of the base, 135, 90, 45, 0, -45 deg to the ground, there and back."""
    inclinations = [135, 90, 45, 0, -45, 0, 45, 90, 135]
    return WaypointMotion(
        [(base_orientation(math.radians(i)), hold if k == 0 else 10.0) for k, i in enumerate(inclinations)], rate
    )


def base_orientation(inclination: float, roll: float = 0.0) -> np.ndarray:
    """Rotation (3, 3), world from soft_base, for an inclination and a roll in rad."""
    c, s = math.cos(inclination), math.sin(inclination)
    horizontal = np.array([[-s, 0.0, c], [0.0, -1.0, 0.0], [c, 0.0, s]])
    return horizontal @ turned(np.array([0.0, 0.0, roll]))


def turned(rotation_vector: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) of a rotation vector (3,) in rad."""
    result = np.empty((3, 3))
    rotation_exp(np.asarray(rotation_vector, float), result)
    return result


def rotation_from_quaternion(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Rotation (3, 3) of a quaternion, which need not be of unit length. Raises ValueError for one that has none."""
    norm = x * x + y * y + z * z + w * w
    if not math.isfinite(norm) or norm < 1e-12:
        raise ValueError(f"({x}, {y}, {z}, {w}) is not a quaternion of a rotation")
    s = 2.0 / norm
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """(4,) x y z w of a rotation (3, 3), w >= 0."""
    result = np.empty(4)
    rotation_to_quaternion(np.ascontiguousarray(rotation, dtype=float), result)
    return result


def _relative(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) from a to b, in a's frame."""
    result = np.empty(3)
    rotation_log(np.ascontiguousarray(a.T @ b), result)
    return result
