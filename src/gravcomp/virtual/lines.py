"""The true lines of the virtual robot's cables: stiffness, free length and friction of each.

A value in the section `virtual_robot.tendons` holds for every cable. Otherwise each cable is as described in `robot.cables`; what
is described nowhere is that of a stiff cable, which stretches by one thousandth at the robot's largest tension (steel wire at a
fifth of its strength), in a sheath that turns a little.
"""

from dataclasses import dataclass

import numpy as np

from gravcomp.description import Robot
from gravcomp.virtual.parameters import Tendons

_STIFF_STRAIN = 1e-3
_FRICTION, _GUIDE_ANGLE = 0.08, np.radians(20.0)


@dataclass(frozen=True)
class Lines:
    """Lines of m cables: stiffness E A (m,) in N; free_length (m,) in m; friction (m,) coefficient; guide_angle (m,) in rad."""

    stiffness: np.ndarray
    free_length: np.ndarray
    friction: np.ndarray
    guide_angle: np.ndarray


def true_lines(robot: Robot, tendons: Tendons) -> Lines:
    """Return the lines of the robot's cables with the deviations in `tendons`."""

    def each(given: float | None, name: str, fallback: float) -> np.ndarray:
        described = [getattr(cable, name) for cable in robot.cables]
        return np.array([given if given is not None else fallback if own is None else own for own in described], dtype=float)

    stiffness = [cable.stiffness if cable.stretches else robot.limits.tension_max / _STIFF_STRAIN for cable in robot.cables]
    if tendons.axial_stiffness is not None:
        stiffness = [tendons.axial_stiffness] * len(robot.cables)
    return Lines(
        np.array(stiffness),
        each(tendons.free_length, "free_length", 0.0),
        each(tendons.friction, "friction", _FRICTION),
        each(tendons.guide_angle, "sheath_angle", _GUIDE_ANGLE),
    )
