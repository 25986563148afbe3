"""A robot's backbone as a smooth curve of frames, interpolated between the few points of a message.

Positions follow a cubic Hermite curve whose tangents are the z axes of the frames, scaled by the distance of the neighbours.
Quaternions are interpolated linearly and normalised, which is exact enough for neighbours that differ by a few degrees.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from gravcomp.description import Robot

_REST_POINTS = 65


@dataclasses.dataclass(frozen=True)
class Backbone:
    """Frames along the robot: station (n,) 0 at the base to 1 at the tip, position (n, 3) m, orientation (n, 4) x y z w."""

    station: np.ndarray
    position: np.ndarray
    orientation: np.ndarray

    @property
    def tip(self) -> np.ndarray:
        """Position of the tip (3,), m."""
        return self.position[-1]

    def at(self, station: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (k, 3) in m and rotations (k, 3, 3) at the stations (k,); beyond the ends those of the end frames."""
        s = np.clip(station, self.station[0], self.station[-1])
        i = np.clip(np.searchsorted(self.station, s, side="right") - 1, 0, len(self.station) - 2)
        t = ((s - self.station[i]) / (self.station[i + 1] - self.station[i]))[:, None]
        q0, q1 = self.orientation[i], self.orientation[i + 1]
        q1 = np.where((q0 * q1).sum(axis=1, keepdims=True) < 0.0, -q1, q1)
        q = q0 + t * (q1 - q0)
        rotation = rotations(q / np.linalg.norm(q, axis=1, keepdims=True))
        p0, p1 = self.position[i], self.position[i + 1]
        length = np.linalg.norm(p1 - p0, axis=1, keepdims=True)
        m0, m1 = length * rotations(q0)[:, :, 2], length * rotations(q1)[:, :, 2]
        t2, t3 = t * t, t * t * t
        position = (2 * t3 - 3 * t2 + 1) * p0 + (t3 - 2 * t2 + t) * m0 + (3 * t2 - 2 * t3) * p1 + (t3 - t2) * m1
        return position, rotation


def arc_backbone(length: float, angle: float, plane: float, points: int = 33) -> Backbone:
    """Return a robot of `length` (m) with constant curvature, bent by `angle` (rad) toward `plane` (rad, about z from x)."""
    from gravcomp.inverse.target import arc_points

    station = np.linspace(0.0, 1.0, points)
    half = 0.5 * angle * station
    # Rotated about the normal of the bending plane, so that the frames do not twist.
    sine = np.sin(half)
    orientation = np.stack([-np.sin(plane) * sine, np.cos(plane) * sine, np.zeros(points), np.cos(half)], axis=1)
    return Backbone(station, arc_points(length, angle, plane, station), orientation)


def rest_backbone(robot: Robot) -> Backbone:
    """Return the robot at rest, without load."""
    from scipy.spatial.transform import Rotation

    from gravcomp.mesh.robot_axis import rest_axis

    station = np.linspace(0.0, 1.0, _REST_POINTS)
    position, rotation = rest_axis(robot).frames(station * robot.length)
    return Backbone(station, position, Rotation.from_matrix(rotation).as_quat())


def rotations(q: np.ndarray) -> np.ndarray:
    """Return the rotations (k, 3, 3) of unit quaternions (k, 4), x y z w."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )


def rotation_from_wxyz(q: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a unit quaternion (4,), w x y z, as viser has it."""
    return rotations(np.roll(np.asarray(q, dtype=float), -1)[None])[0]
