"""From the angle of a joint to the displacement at its capstan, and back.

    u = r d (q - q_0) + offset,        with a lookup  u = f(d (q - q_0)) + offset

d is the direction, q_0 the zero position, r the radius; beyond its ends f continues with the slope of its last piece.
"""

import bisect
import dataclasses
import math

from gravcomp.description.hardware import Drive
from gravcomp.description.joint_motors import JointMotor


class JointScale:
    """Scale of one joint. Attributes: zero (rad, None while it is unknown), drive (Drive with the radius of this capstan)."""

    def __init__(self, motor: JointMotor, drive: Drive):
        self._motor = motor
        self.zero = motor.zero
        self._angles: tuple[float, ...] = (0.0, 1.0)
        self._travels: tuple[float, ...] = (0.0, drive.capstan_radius if motor.capstan_radius is None else motor.capstan_radius)
        if motor.lookup is not None:
            self._angles, self._travels = motor.lookup.angle, motor.lookup.displacement
        mean = (self._travels[-1] - self._travels[0]) / (self._angles[-1] - self._angles[0])
        self.drive = dataclasses.replace(drive, capstan_radius=mean)

    def displacement(self, angle: float) -> float:
        """Return the displacement (m) at an angle (rad) of the joint; 0 while the zero position is unknown."""
        if self.zero is None:
            return 0.0
        turned = self._motor.direction * (angle - self.zero)
        i = self._piece(self._angles, turned)
        return self._travels[i] + self._slope(i) * (turned - self._angles[i]) + self._motor.offset

    def angle(self, displacement: float) -> float:
        """Return the angle (rad) of the joint for a displacement (m). The zero position must be known."""
        travel = displacement - self._motor.offset
        i = self._piece(self._travels, travel)
        turned = self._angles[i] + (travel - self._travels[i]) / self._slope(i)
        return (self.zero or 0.0) + self._motor.direction * turned

    def radius(self, angle: float) -> float:
        """Return the displacement per angle (m/rad) near an angle (rad), positive."""
        turned = 0.0 if self.zero is None else self._motor.direction * (angle - self.zero)
        return self._slope(self._piece(self._angles, turned))

    def limits(self) -> tuple[float, float]:
        """Return the smallest and largest displacement (m): those of the drive, the joint's angles and the lookup together.

        The angles count once the zero position is known.
        """
        low, high = self.drive.displacement_min, self.drive.displacement_max
        if self._motor.lookup is not None:
            low, high = max(low, self._travels[0] + self._motor.offset), min(high, self._travels[-1] + self._motor.offset)
        if self.zero is not None:
            ends = [
                self.displacement(angle) if angle is not None else math.copysign(math.inf, sense * self._motor.direction)
                for angle, sense in ((self._motor.angle_min, -1), (self._motor.angle_max, 1))
            ]
            low, high = max(low, min(ends)), min(high, max(ends))
        return low, high

    def _piece(self, points: tuple[float, ...], value: float) -> int:
        return min(max(bisect.bisect_right(points, value) - 1, 0), len(points) - 2)

    def _slope(self, piece: int) -> float:
        return (self._travels[piece + 1] - self._travels[piece]) / (self._angles[piece + 1] - self._angles[piece])
