"""How far a robot bends under its own weight, by the theory of small bending of beams (Bernoulli and Euler)."""

import math

import numpy as np

from gravcomp.description.robot import Robot
from gravcomp.standard_gravity import STANDARD_GRAVITY

_PARTS = 40  # of the length


def bend_by_own_weight(robot: Robot) -> float | None:
    """Return the turn in rad of the tip of the released robot, straight and held horizontally, with its payload.

    With the mass m per length and the bending stiffness E I of each section, theta = int g int_s^L m (x - s) dx / (E I) ds. Each
    section bends about its weakest axis. None for a body from a file, whose sections nobody has described.
    """
    if not robot.pieces:
        return None
    step = robot.length / _PARTS
    station = step * (np.arange(_PARTS) + 0.5)
    mass, flexibility = np.zeros(_PARTS), np.zeros(_PARTS)
    for k, s in enumerate(station):
        piece = robot.piece_at(float(s))
        section = piece.moments(float(s))
        mass[k] = piece.material.density * section.area * step
        flexibility[k] = 1.0 / (piece.material.youngs_modulus * min(section.xx, section.yy))
    arm = np.maximum(station[None, :] - station[:, None], 0.0)
    moment = STANDARD_GRAVITY * (arm @ mass + robot.payload.mass * (robot.length - station))
    return float((moment * flexibility).sum() * step)


def largest_pitch_radius(robot: Robot) -> float:
    """Return the largest distance in m of a cable from the robot's axis, where the cables begin or end; 0 without cables."""
    places = [robot.cable_place(cable, s) for cable in robot.cables for s in (cable.start, robot.cable_end(cable))]
    return max((math.hypot(*place) for place in places), default=0.0)
