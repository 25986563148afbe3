"""The axis of a robot at rest: straight, or a chain of circular arcs.

A point of the straightened robot has the coordinates (x, y, s): its place in the cross-section, and the arc length of that
section. On the robot at rest it lies at P(s) + R(s) (x, y, 0). The axis starts at the origin along z.
"""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Arc:
    """A piece of the axis: length (m), the angle (rad) it turns, and the direction (rad, from x) that it bends towards."""

    length: float
    angle: float = 0.0
    plane: float = 0.0


@dataclasses.dataclass(frozen=True)
class RestAxis:
    """The arcs from base to tip; none: the axis is straight."""

    arcs: tuple[Arc, ...] = ()

    @property
    def bent(self) -> bool:
        """Whether any piece turns."""
        return any(arc.angle for arc in self.arcs)

    def bent_further(self, angle: float, plane: float) -> "RestAxis":
        """Return the axis whose curvature is larger by that of an arc of its length: `angle` (rad) towards `plane` (rad)."""
        length = sum(arc.length for arc in self.arcs)
        bent = []
        for arc in self.arcs:
            own, more = arc.angle / arc.length, angle / length
            x = own * np.cos(arc.plane) + more * np.cos(plane)
            y = own * np.sin(arc.plane) + more * np.sin(plane)
            bent.append(Arc(arc.length, float(np.hypot(x, y)) * arc.length, float(np.arctan2(y, x))))
        return RestAxis(tuple(bent))

    def points(self, straight: np.ndarray) -> np.ndarray:
        """Return where the points (n, 3) of the straightened robot lie at rest (n, 3)."""
        straight = np.asarray(straight, dtype=float).reshape(-1, 3)
        if not self.bent:
            return straight.copy()
        position, rotation = self.frames(straight[:, 2])
        return position + np.einsum("nij,nj->ni", rotation[:, :, :2], straight[:, :2])

    def frames(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (n, 3) of the axis and orientations (n, 3, 3) of its sections at the arc lengths s (n,)."""
        s = np.asarray(s, dtype=float)
        position, rotation = np.zeros((len(s), 3)), np.tile(np.eye(3), (len(s), 1, 1))
        if not self.arcs:
            position[:, 2] = s
            return position, rotation
        start, origin, frame = 0.0, np.zeros(3), np.eye(3)
        for index, arc in enumerate(self.arcs):
            last = index == len(self.arcs) - 1
            here = (s >= start if index else np.full(len(s), True)) & (np.full(len(s), last) | (s < start + arc.length))
            local_position, local_rotation = _along(arc, s[here] - start)
            position[here] = origin + local_position @ frame.T
            rotation[here] = frame @ local_rotation
            end_position, end_rotation = _along(arc, np.array([arc.length]))
            origin, frame = origin + frame @ end_position[0], frame @ end_rotation[0]
            start += arc.length
        return position, rotation

    def curvature(self, s: np.ndarray) -> np.ndarray:
        """Return the curvatures (n, 2) in 1/m towards x and y of the sections at the arc lengths s (n,)."""
        if not self.arcs:
            return np.zeros((len(s), 2))
        values = np.array([(np.cos(arc.plane), np.sin(arc.plane)) for arc in self.arcs])
        values *= np.array([[arc.angle / arc.length] for arc in self.arcs])
        return values[np.searchsorted(np.cumsum([arc.length for arc in self.arcs[:-1]]), s, side="right")]


STRAIGHT = RestAxis()
"""The axis of a robot that is straight at rest."""


def straightened(axis: RestAxis, points: np.ndarray, length: float) -> np.ndarray:
    """Return places in the sections and arc lengths (n, 3) of points (n, 3): the inverse of `RestAxis.points`."""
    s = np.linspace(-0.02, 1.02, 105) * length
    line = axis.frames(s)[0]
    at = s[np.argmin(((points[:, None] - line[None]) ** 2).sum(axis=2), axis=1)]
    for _ in range(200):
        position, rotation = axis.frames(at)
        offset = points - position
        change = np.einsum("ni,ni->n", offset, rotation[:, :, 2])
        # Newton's step: a section inside of a bend is nearer than the arc is long. It is at most doubled.
        across = np.einsum("ni,nij->nj", offset, rotation[:, :, :2])
        at = at + change / np.maximum(1.0 - (across * axis.curvature(at)).sum(axis=1), 0.5)
        if np.abs(change).max() < 1e-14 * length:
            break
    position, rotation = axis.frames(at)
    place = np.einsum("ni,nij->nj", points - position, rotation[:, :, :2])
    return np.column_stack([place, at])


def _along(arc: Arc, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and orientations (n, 3, 3) at the arc lengths s (n,) of an arc that starts at the origin along z."""
    angle = arc.angle * s / arc.length
    half = 0.5 * angle
    chord = s * np.sinc(half / np.pi)  # 2 R sin(angle / 2)
    aside, ahead = chord * np.sin(half), chord * np.cos(half)
    cos, sin = np.cos(arc.plane), np.sin(arc.plane)
    position = np.column_stack([aside * cos, aside * sin, ahead])
    turn, bend = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]), np.zeros((len(s), 3, 3))
    bend[:, 0, 0] = bend[:, 2, 2] = np.cos(angle)
    bend[:, 0, 2], bend[:, 2, 0], bend[:, 1, 1] = np.sin(angle), -np.sin(angle), 1.0
    return position, turn @ bend @ turn.T
