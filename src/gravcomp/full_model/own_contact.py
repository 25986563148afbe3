"""Contact of a robot with itself: places, rows and memory, the same for every model that moves its stations."""

from typing import NamedTuple

import numpy as np

from gravcomp.contact.contacts import Contacts
from gravcomp.contact.own_pairs import may_touch, part_that_passes
from gravcomp.contact.own_places import MOVED, OwnPlaces, find_own
from gravcomp.contact.own_rows import own_rows, own_turning
from gravcomp.contact.own_surface import own_surface
from gravcomp.contact.surface import ContactSurface
from gravcomp.description import Robot

# Distances of stations by which the other part of a place may have moved on since last time.
_MOVED_ON = 2.5


class OwnTouch(NamedTuple):
    """Places where the robot touches itself, their forces (c,) in N, and the changes (c, m) of these by the cables' tensions."""

    places: OwnPlaces
    force: np.ndarray
    by_tension: np.ndarray


class OwnRows(NamedTuple):
    """Places near each other, for forces at the stations: gaps (c,), turning (e,) with D (e,), first guesses (c,) in N.

    gaps (c, 9 s) and turning (e, 9 s): rows for the displacements of p, f_1, f_2 of the stations.
    """

    places: OwnPlaces
    gaps: np.ndarray
    turning: np.ndarray
    bend: np.ndarray
    pressed: np.ndarray


class OwnContact:
    """Finds where a robot touches itself. Attribute: surface."""

    def __init__(self, robot: Robot, surface: ContactSurface):
        """Raises ValueError for a robot whose sections are not round."""
        self.surface = own_surface(robot, surface)
        self._length = robot.length

    def rows(self, sections: np.ndarray, moved: np.ndarray, margin: float, last: OwnTouch | None) -> OwnRows | None:
        """Return the places of the robot whose stations are at `sections` (s, 3, 3); None: it is nowhere near itself.

        moved (s, 3): how far the stations would go in m; margin: nearer places are returned too; last: of last time.
        """
        pressed = (np.zeros((0, 2)), np.zeros(0)) if last is None else (last.places.place, last.force)
        places = find_own(self.surface, self._with_base(sections), np.vstack([np.zeros(3), moved]), margin, *pressed)
        if not len(places.kind):
            return None
        guess = _remembered(places, last)
        turning, bend = own_turning(places, guess, len(sections), self._length)
        return OwnRows(places, own_rows(places, len(sections)), turning, bend, guess)

    def warm_up(self) -> None:
        """Compile what a robot needs that touches itself: it is wound up in rings that touch, twice."""
        place = self.surface.place[1:]
        ring = place[-1] / 3.0
        angle, wide = 2.0 * np.pi * place / ring, 0.5 * ring / np.pi
        pitch = 2.0 * float(self.surface.radius.max())
        middle = np.column_stack([wide * (1.0 - np.cos(angle)), pitch * place / ring, wide * np.sin(angle)])
        one = np.column_stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)])
        sections = np.stack([middle, one, np.tile([0.0, 1.0, 0.0], (len(place), 1))], axis=1)
        touch = None
        for _ in range(2):
            rows = self.rows(sections, np.zeros_like(middle), pitch, touch)
            if rows is not None:
                count = len(rows.places.kind)
                touch = OwnTouch(rows.places, np.ones(count), np.zeros((count, 0)))
        self.contacts(touch, sections, 0, "")
        self.part_that_passes(sections, middle)
        self.is_near(sections, pitch)

    def is_near(self, sections: np.ndarray, margin: float) -> bool:
        """Whether parts of the robot whose stations are at `sections` (s, 3, 3) are nearer than about `margin` m."""
        near: bool = may_touch(self.surface, self._with_base(sections[:, :1]), margin)
        return near

    def part_that_passes(self, sections: np.ndarray, moved: np.ndarray) -> float:
        """Return the part of a step that moves the stations by moved (s, 3) m in which no part of the robot passes another."""
        part: float = part_that_passes(self.surface, self._with_base(sections), np.vstack([np.zeros(3), moved]))
        return part

    def contacts(self, touch: OwnTouch | None, sections: np.ndarray, number: int, name: str) -> Contacts:
        """Return what touches, once for each two places: where the farther one is, with the force on it.

        sections (s, 3, 3): of the stations now; number and name: as of an obstacle.
        """
        pressed = np.zeros(0, dtype=np.int64) if touch is None else np.flatnonzero(touch.force > 0.0)
        if touch is None or not len(pressed):
            return Contacts.none()
        whole, (places, force, by_tension) = self._with_base(sections), touch
        middle = [np.einsum("cn,cnij->cij", places.share[:, e], whole[places.first[:, e, None] + np.arange(4)]) for e in range(2)]
        far = middle[0][:, 0] + np.einsum("ci,cij->cj", places.own, middle[0][:, 1:])
        between, apart = far - middle[1][:, 0], places.distance - places.gap
        radii = np.interp(places.place, np.arange(len(whole)), self.surface.radius)
        radius = apart * radii[:, 0] / radii.sum(axis=1) * ~places.own.any(axis=1)  # that of the strained section
        stations = np.interp(places.place, np.arange(len(whole)), self.surface.place) / self._length
        return Contacts(
            obstacle=np.full(len(pressed), number),
            station=stations[pressed, 0],
            position=(far - radius[:, None] * places.normal)[pressed],
            normal=places.normal[pressed],
            force=(force[:, None] * places.normal)[pressed],
            gap=(np.linalg.norm(between, axis=1) - apart)[pressed],
            sliding=np.ones(len(pressed), dtype=np.bool_),
            by_tension=by_tension[pressed],
            names=(name,) * len(pressed),
            against=stations[pressed, 1],
        )

    def _with_base(self, sections: np.ndarray) -> np.ndarray:
        """Return the sections (s + 1, v, 3) with that of the base, which does not move."""
        return np.concatenate([np.vstack([np.zeros(3), np.eye(3)[:2]])[None, : sections.shape[1]], sections])


def _remembered(places: OwnPlaces, last: OwnTouch | None) -> np.ndarray:
    """Return the forces (c,) of last time; a place that moves along the robot may have been that of the next station."""
    guess = np.zeros(len(places.kind))
    if last is None:
        return guess
    before = last.places
    for i, (slot, place) in enumerate(zip(places.slot, places.place)):
        near = np.abs(before.place[:, 1] - place[1]) < _MOVED_ON
        same = near & (before.slot == slot)
        if not same.any() and places.kind[i] == MOVED:
            same = near & (np.abs(before.slot - slot) == 1) & (before.kind == MOVED)
        guess[i] = last.force[same].max(initial=0.0)
    return guess
