"""Spacer disks: rigid, and each attached to a cross-section of the backbone.

A hole at (x, y) of a disk lies at p + x f_1 + y f_2 with the section's functionals (`mesh.sections`), which are linear in
the nodes. f_1 and f_2 are unit vectors at rest; they keep their length as far as the backbone's section keeps its size, which
stiff backbones do.
"""

import dataclasses

import numpy as np

from gravcomp.description import Robot
from gravcomp.mesh.embedding import Embedding
from gravcomp.mesh.mesh import Mesh
from gravcomp.mesh.sections import section_functionals


@dataclasses.dataclass(frozen=True)
class DiskWeights:
    """Inertia of d disks and where it acts.

    mass (d,) in kg; inertia (d,): moments of inertia about a diameter in kg m^2; rows (d, 3, n): p, f_1, f_2 of their sections.
    """

    mass: np.ndarray
    inertia: np.ndarray
    rows: np.ndarray


def disk_heights(robot: Robot) -> np.ndarray:
    """Return the arc lengths (d,) in m of the disks.

    The base guides cables like a disk if the first segment has disks.
    """
    heights, base = [], 0.0
    for index, segment in enumerate(robot.segments):
        if segment.disks:
            heights += [0.0] if index == 0 else []
            heights += [base + height for height in segment.disks.heights(segment.length)]
        base += segment.full_length
    return np.array(heights)


def holes(places: np.ndarray, rows: np.ndarray) -> Embedding:
    """Attach holes at the places (p, 2) in m of the sections whose functionals are the rows (p, 3, n)."""
    hole = rows[:, 0] + places[:, :1] * rows[:, 1] + places[:, 1:2] * rows[:, 2]
    width = int((hole != 0.0).sum(axis=1).max())
    order = np.argsort(hole == 0.0, axis=1, kind="stable")[:, :width]
    weights = np.take_along_axis(hole, order, axis=1)
    # Padding repeats a node with the weight 0, so that no other nodes are coupled.
    return Embedding(np.where(weights != 0.0, order, order[:, :1]), weights, np.zeros(len(places)))


def disk_masses(robot: Robot) -> list[tuple[float, float, float, float]]:
    """Return the arc length (m), the mass (kg) and the moments of inertia about a diameter and the axis (kg m^2) of each disk."""
    found, base = [], 0.0
    for segment in robot.segments:
        if segment.disks:
            diameter, thickness = segment.disks.outer_diameter, segment.disks.thickness
            for height in segment.disks.heights(segment.length):
                mass = segment.disks.mass_of(segment.hole_of_disks(height / segment.length).area)
                found.append((base + height, mass, mass * (diameter**2 / 16 + thickness**2 / 12), mass * diameter**2 / 8))
        base += segment.full_length
    return found


def disk_weights(robot: Robot, mesh: Mesh) -> DiskWeights | None:
    """Return what the disks weigh; None for a robot without disks that weigh anything."""
    heights, mass, inertia, _ = np.array(disk_masses(robot)).reshape(-1, 4).T.copy()
    if not mass.any():
        return None
    return DiskWeights(mass, inertia, section_functionals(mesh, heights).reshape(len(heights), 3, -1))
