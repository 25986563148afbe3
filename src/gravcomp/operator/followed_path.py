"""The shape that a person steers: he bends the tip, and the body follows the path that the tip has taken.

The curvature over the arc length s of the path, from the mouth of the lumen, is what the lever commanded when the tip was
there. As the base is pushed in, the body takes over the curvature of its place (follow the leader; H. Choset, W. Henning, "A
follow-the-leader approach to serpentine robot motion planning", J. Aerosp. Eng. 12, 1999).
"""

import numpy as np

from gravcomp.inverse import Target
from gravcomp.virtual.motion import turned

_STATIONS, _WEIGHTS = (0.25, 0.5, 0.75), (0.3, 0.3, 0.3)


class FollowedPath:
    """The path of the tip, straight at first."""

    def __init__(self, length: float, tip_length: float, largest: float, direction_weight: float):
        """length, tip_length (m): of the robot, and of the part of it that the lever bends; largest: curvature, 1/m."""
        self._length, self._tip_length, self._largest, self._weight = length, tip_length, largest, direction_weight
        self._step = length / 100
        self._curvature = np.zeros((400, 2))  # over s from -length on; along x and y of the section
        self.lever = np.zeros(2)  # 1/m

    def bend(self, angle: np.ndarray) -> None:
        """Turn the tip by the angles (2,) in rad, along x and y of its section."""
        self.lever = self.lever + angle / self._tip_length
        size = float(np.linalg.norm(self.lever))
        self.lever *= min(1.0, self._largest / max(size, 1e-12))

    def target(self, depth: float) -> Target:
        """Return the shape with the tip at the arc length `depth` m, in soft_base."""
        first = int((depth - self._tip_length + self._length) / self._step)
        self._curvature[max(0, first) :] = self.lever
        count = round(self._length / self._step)
        points, rotation, place = [np.zeros(3)], np.eye(3), np.zeros(3)
        for k in range(count):
            s = depth + (k + 0.5) * self._step  # of the path, from -length on
            x, y = self._curvature[min(max(int(s / self._step), 0), len(self._curvature) - 1)]
            half = turned(np.array([-y, x, 0.0]) * 0.5 * self._step)
            rotation = rotation @ half
            place = place + rotation[:, 2] * self._step
            rotation = rotation @ half
            points.append(place)
        body = np.array([points[round(station * count)] for station in _STATIONS])
        return Target(
            tip_position=points[-1],
            tip_direction=rotation[:, 2],
            tip_direction_weight=self._weight,
            backbone_station=np.array(_STATIONS),
            backbone_position=body,
            backbone_weight=np.array(_WEIGHTS),
        )
