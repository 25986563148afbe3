"""A plane that a user puts next to the running virtual robot, and moves.

The wall goes to the place where it is wanted at a bounded speed, as if somebody slid it there, because a wall that jumped into
the robot would have to be thrown out of it within one step. It begins where it does not touch the robot, and stops while it
presses the robot with its largest force, which follows from the rod as the hand's does.
"""

import dataclasses

import numpy as np

from gravcomp.config import ConfigError, from_mapping
from gravcomp.scene import PlaneWall
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.surroundings import RodSurroundings

_SPEED = 1.0  # lengths of the robot, and radians, per second
_HARDER = 8.0  # than the largest force of the hand: at half the length a rod is so much stiffer than at its tip
_FARTHEST = 10.0  # lengths of the robot


def parse_wall(mapping: object, source: str, length: float, base_radius: float) -> PlaneWall:
    """Return the wall in `mapping`, in the keys of `scene.planes`.

    length: of the robot; base_radius: of its base, which no wall may cut, both in m. Raises ConfigError.
    """
    wall = from_mapping(PlaneWall, mapping, source=source)
    if wall.frame != "soft_base":
        raise ConfigError(f"{source}: frame is {wall.frame}; a wall that is placed while the robot runs needs soft_base")
    if wall.forbidden:
        raise ConfigError(f"{source}: forbidden is true; only a wall can be placed while the robot runs")
    normal = np.array(wall.normal) / np.linalg.norm(wall.normal)
    offset = float(normal @ np.array(wall.point))
    if abs(offset) > _FARTHEST * length:
        raise ConfigError(f"{source}: the wall is {1e3 * abs(offset):.4g} mm away; allowed: up to {1e4 * length:.4g} mm")
    depth = offset + base_radius * float(np.hypot(normal[0], normal[1]))
    if depth > 0.0:
        raise ConfigError(
            f"{source}: the wall cuts the robot's base, which is {1e3 * depth:.3g} mm inside it; move point_mm by that against"
            " the normal"
        )
    x, y, z = (float(part) for part in normal)
    return dataclasses.replace(wall, normal=(x, y, z), point=(offset * x, offset * y, offset * z))


class PlacedWall:
    """The wall that a user has put next to a rod; at first there is none.

    Attributes: length (m) of the rod; base_radius (m) of its base.
    """

    def __init__(self, rod: MovingRod, around: RodSurroundings, force_max: float):
        """around: what else is around the rod, with the surface of the rod; force_max: the hand's largest force, N."""
        self._rod, self._around = rod, around
        self.length, self.base_radius = float(rod.model.length.sum()), float(around.surface.size[0])
        self._force_max = _HARDER * force_max
        self._middle = np.array([0.0, 0.0, self.length / 2])  # about which the wall turns
        self._wanted: PlaneWall | None = None
        self._normal, self._offset = np.array([0.0, 0.0, 1.0]), 0.0

    @property
    def plane(self) -> tuple[np.ndarray, np.ndarray] | None:
        """A point (3,) m and the normal (3,) of the wall where it is now, in soft_base; None without a wall."""
        return None if self._wanted is None else (self._offset * self._normal, self._normal)

    @property
    def name(self) -> str:
        """Name of the wall."""
        return (self._wanted.name if self._wanted else "") or "placed wall"

    @property
    def row(self) -> int:
        """Row of the wall in the scene of the rod."""
        return len(self._around.walls.moving)

    def place(self, wall: PlaneWall | None) -> None:
        """Let the wall go to `wall`, see `parse_wall`; None: take it away at once."""
        if wall is None:
            self._rod.surround(self._around)
        elif self._wanted is None or (wall.friction, wall.stiffness) != (self._wanted.friction, self._wanted.stiffness):
            self._normal = np.array(wall.normal)
            self._offset = min(float(self._normal @ np.array(wall.point)), self._touching_offset())
            self._rod.surround(self._around.with_plane(wall))
        self._wanted = wall

    def step(self, dt: float) -> None:
        """Move the wall for `dt` s."""
        if self._wanted is None:
            return
        touches = self._rod.touches
        pressed = float(np.linalg.norm(touches.force[touches.row == self.row].sum(axis=0))) > self._force_max
        target = np.array(self._wanted.normal)
        gap = float(self._normal @ self._middle) - self._offset  # of the point about which it turns
        wanted = float(target @ self._middle) - float(target @ np.array(self._wanted.point))
        if not pressed:
            self._normal = _turned(self._normal, target, _SPEED * dt)
        if not pressed or wanted > gap:
            most = _SPEED * self.length * dt
            gap += float(np.clip(wanted - gap, -most, most))
        self._offset = float(self._normal @ self._middle) - gap
        self._rod.move_plane(self.row, self._offset * self._normal, self._normal)

    def _touching_offset(self) -> float:
        """Return the offset of the plane along its normal at which it just does not touch the robot, m."""
        rod = self._rod
        place = (rod.position - rod.position[0]) @ rod.orientation[0]
        return float((place @ self._normal - self._around.surface.size[: len(place)]).min())


def _turned(normal: np.ndarray, target: np.ndarray, most: float) -> np.ndarray:
    """Turn a unit vector towards another by at most so many rad."""
    across = target - (target @ normal) * normal
    size = float(np.linalg.norm(across))
    angle = float(np.arctan2(size, target @ normal))
    if angle <= most:
        return target
    if size < 1e-9:  # the opposite direction: by any way
        across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        size = float(np.linalg.norm(across))
    return np.cos(most) * normal + np.sin(most) * across / size
