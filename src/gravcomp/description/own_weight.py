"""How far a robot bends under its own weight, by the theory of small bending of beams (Bernoulli and Euler)."""

import math

import numpy as np

from gravcomp.description.body import Material
from gravcomp.description.body_sections import body_sections
from gravcomp.description.robot import Robot
from gravcomp.description.section_moments import SectionMoments
from gravcomp.mesh_files import MeshError
from gravcomp.standard_gravity import STANDARD_GRAVITY

_PARTS = 40  # of the length


def bend_by_own_weight(robot: Robot) -> float | None:
    """Return the turn in rad of the tip of the released robot, straight and held horizontally, with all that it carries.

    With the mass m per length and the bending stiffness E I of each section, theta = int g int_s^L m (x - s) dx / (E I) ds. Each
    section bends about its weakest axis. Disks, payload and hung weights are masses at their places along the robot. None for a
    file that describes no body, which is refused where the body is needed.
    """
    try:
        step = robot.length / _PARTS
        station = step * (np.arange(_PARTS) + 0.5)
        sections = _sections(robot, station)
    except MeshError:
        return None
    mass = np.array([material.density * section.area * step for material, section in sections])
    flexibility = np.array([1.0 / (material.axial_modulus * min(section.xx, section.yy)) for material, section in sections])
    places, masses = np.array(_carried(robot)).T
    arm = np.maximum(np.append(station, places)[None, :] - station[:, None], 0.0)
    moment = STANDARD_GRAVITY * (arm @ np.append(mass, masses))
    return float((moment * flexibility).sum() * step)


def _sections(robot: Robot, stations: np.ndarray) -> list[tuple[Material, SectionMoments]]:
    """Return material and section at stations (k,) in m along the axis. Raises MeshError."""
    if robot.body is not None:
        return [(robot.body.material, section) for section in body_sections(robot.body, stations)]
    pieces = [robot.piece_at(float(s)) for s in stations]
    return [(piece.material, piece.moments(float(s))) for piece, s in zip(pieces, stations)]


def _carried(robot: Robot) -> list[tuple[float, float]]:
    """Return the arc length in m and the mass in kg of the payload, of hung weights and of disks."""
    found = [(robot.length, robot.payload.mass), *((load.at[2], load.mass) for load in robot.loads)]
    base = 0.0
    for segment in robot.segments:
        disks = segment.disks
        if disks is not None:
            heights = disks.heights(segment.length)
            found += [(base + s, disks.mass_of(segment.hole_of_disks(s / segment.length).area)) for s in heights]
        base += segment.full_length
    return found


def largest_pitch_radius(robot: Robot) -> float:
    """Return the largest distance in m of a cable from the robot's axis, where the cables begin or end; 0 without cables."""
    places = [robot.cable_place(cable, s) for cable in robot.cables for s in (cable.start, robot.cable_end(cable))]
    return max((math.hypot(*place) for place in places), default=0.0)
