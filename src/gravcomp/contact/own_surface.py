"""The robot's surface for contact with itself: balls around the middles of stations from base to tip."""

from typing import NamedTuple

import numpy as np

from gravcomp.contact.surface import ContactSurface
from gravcomp.description import Robot


class OwnSurface(NamedTuple):
    """Stations from base to tip, both included.

    place (n,): m along the robot at rest; radius (n,) m; rim (k, 2): points around the tip's face.
    """

    place: np.ndarray
    radius: np.ndarray
    rim: np.ndarray


def own_surface(robot: Robot, surface: ContactSurface) -> OwnSurface:
    """Return the surface of a robot with that for contact with obstacles. Raises ValueError where a section is not round."""
    outlines = [robot.piece_at(s).visible.section(min(s, robot.length))[0] for s in (0.0, *surface.place)]
    for s, outline in zip((0.0, *surface.place), outlines):
        if not outline.round:
            raise ValueError(f"a robot touches itself with round sections only; that {1e3 * s:.0f} mm from the base is not round")
    place = np.concatenate([[0.0], surface.place])
    radius = np.array([outline.half_width for outline in outlines])
    return OwnSurface(place, radius, surface.rim)
