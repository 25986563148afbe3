"""The robot's surface for contact: outlines of cross-sections at stations along it.

A section moves as a whole: its points are p + x f_1 + y f_2 (`mesh.sections`). Between stations p, f_1 and f_2 are
smooth curves through four of them (`places`).
The tip's face is flat. So that it can lie on a wall ahead, points of its rim can touch too, always the same ones.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.description import Robot

# Stations are at most a radius apart; there are at least and at most so many distances between them.
_FEWEST, _MOST = 40, 120
_CORNERS = 48  # of an outline that is not round
_RIM = 8  # points on the rim of the tip's face; corners of a rectangle are among them


class ContactSurface(NamedTuple):
    """Stations from base to tip, those after the base.

    place (s,): m along the robot; length (s,): m of robot that each stands for; radius (s,) of a round section, about the axis;
    outline (s, k, 2): points of the others, (s, 0, 2) where all are round; rim (n, 2): points around the tip's face.
    """

    place: np.ndarray
    length: np.ndarray
    radius: np.ndarray
    outline: np.ndarray
    rim: np.ndarray

    @property
    def slots(self) -> int:
        """Places that can touch one obstacle."""
        return len(self.place) + len(self.rim)


def contact_surface(robot: Robot) -> ContactSurface:
    """Return the surface of a robot of segments. Raises ValueError for a body from a file."""
    if robot.body is not None:
        raise ValueError("contact needs a robot of segments; a body from a file has no outlines along its axis")
    middle = robot.piece_at(0.5 * robot.length).visible.section(0.5 * robot.length)[0]
    radius = min(middle.half_width, middle.half_height)
    count = int(np.clip(np.ceil(robot.length / radius), _FEWEST, _MOST))
    place = robot.length * np.arange(1, count + 1) / count
    outlines = [robot.piece_at(s).visible.section(min(s, robot.length))[0] for s in place]
    length = np.full(count, robot.length / count)
    length[-1] = 0.5 * length[-1] + radius
    size = np.array([max(outline.half_width, outline.half_height) for outline in outlines])
    rim = outlines[-1].boundary(2.0 * np.pi * np.arange(_RIM) / _RIM)
    if all(outline.round for outline in outlines):
        return ContactSurface(place, length, size, np.zeros((count, 0, 2)), rim)
    angle = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    return ContactSurface(place, length, size, np.array([outline.boundary(angle) for outline in outlines]), rim)


@njit(cache=True)
def size_and_way(surface: ContactSurface, sections: np.ndarray, s: int) -> tuple[float, float]:
    """Return the largest radius of station s at `sections` (s, 3, 3), and the way from the station before, 0 for the first; m."""
    one = two = square = 0.0
    for j in range(3):
        one += sections[s, 1, j] ** 2
        two += sections[s, 2, j] ** 2
        square += (sections[s, 0, j] - sections[max(s - 1, 0), 0, j]) ** 2
    return np.sqrt(max(one, two)) * surface.radius[s], np.sqrt(square)
