"""What is around the rod: walls, the surface that touches them, and what pushes it where it does."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.scene import PlaneWall, SceneSection
from gravcomp.scene.scene import Scene
from gravcomp.virtual.contact import Walls
from gravcomp.virtual.contact_force import Touching, rigid_stiffness, surface_point
from gravcomp.virtual.own_contact import OwnTouching
from gravcomp.virtual.rod import RodModel
from gravcomp.virtual.surface import RodSurface, rod_surface
from gravcomp.virtual.true_robot import TrueRobot

ITSELF = -1
"""In place of the row of an obstacle: the rod itself."""
_DEPTH = 3e-5  # of the rod's length, by which the plane that stands for a wall may differ from it
# Fields of `SceneArrays` with an entry for each row.
_ROWS = ("obstacle", "kind", "rotation", "origin", "size", "sign", "first", "last", "closed", "stiffness", "friction")


@dataclass(frozen=True)
class RodSurroundings:
    """What is around a rod.

    walls; surface of the rod; rigid: stiffness of a point on a rigid wall, N/m; depth: accuracy of the walls, m; itself: whether
    the rod touches itself.
    """

    walls: Walls
    surface: RodSurface
    rigid: float
    depth: float
    itself: bool = False

    @property
    def exist(self) -> bool:
        """Whether there is anything that the rod can touch."""
        return bool(len(self.walls.moving)) or self.itself

    @classmethod
    def of(cls, model: RodModel, true: TrueRobot, scene: Scene) -> "RodSurroundings":
        """Return a scene around a rod.

        Raises ConfigError for a body from a file without a section somewhere, and for a rod with self_contact that is not round.
        """
        walls = Walls(scene.turned(np.eye(3)), ~scene.in_world)
        surface, rigid = rod_surface(model, true), rigid_stiffness(model.stiffness, model.length)
        outlines = slice(model.elements + 1, None)
        round_ones = (surface.corners[outlines] == 0) & np.isclose(surface.half[outlines, 0], surface.half[outlines, 1])
        if scene.self_contact and not round_ones.all():
            raise ConfigError(f"{scene.source}: scene.self_contact: the rod touches itself with round sections only")
        return cls(walls, surface, rigid, _DEPTH * model.length.sum(), scene.self_contact)

    @classmethod
    def none(cls) -> "RodSurroundings":
        """Return surroundings without walls."""
        scene = Scene(SceneSection())
        return cls(Walls(scene.arrays, ~scene.in_world), RodSurface.none(), 1.0, 1.0)

    def with_plane(self, wall: PlaneWall) -> "RodSurroundings":
        """Return these surroundings and a plane in the frame of the base, as a further obstacle with the last row."""
        scene, own = self.walls.scene, Scene(SceneSection(planes=(wall,))).turned(np.eye(3))
        own = own._replace(obstacle=np.array([scene.obstacle.max(initial=-1) + 1]))
        rows: dict[str, Any] = {name: np.concatenate([getattr(scene, name), getattr(own, name)]) for name in _ROWS}
        return replace(self, walls=Walls(scene._replace(**rows), np.append(self.walls.moving, True)))


@dataclass(frozen=True)
class Touches:
    """Places where walls push a rod, t of them.

    force (t, 3) N on the rod and place (t, 3) m, in the fixed frame; depth (t,) m in the wall; row (t,): of the obstacle,
    ITSELF where the rod touches itself. There the opposite force acts on its other part.
    """

    force: np.ndarray
    place: np.ndarray
    depth: np.ndarray
    row: np.ndarray

    def and_more(self, others: "Touches") -> "Touches":
        """Return these places and others."""
        return Touches(*(np.concatenate([getattr(self, f.name), getattr(others, f.name)]) for f in fields(self)))


def touches_of(touching: Touching, orientation: np.ndarray, position: np.ndarray) -> Touches:
    """Return the points of `touching` that a wall pushes, on a rod at orientation (n + 1, 3, 3) and position (n + 1, 3) m."""
    used = np.flatnonzero(touching.force[: touching.count[0]].any(axis=1))
    place = np.empty((len(used), 3))
    for x, c in zip(place, used):
        surface_point(orientation, position, touching.section[c], touching.weight[c, 0], touching.arm[c], x)
    return Touches(touching.force[used], place, -touching.gap[used], touching.row[used])


def own_touches_of(own: OwnTouching, orientation: np.ndarray, position: np.ndarray) -> Touches:
    """Return the pairs of places that push each other, each at its place that is farther from the base."""
    used = np.flatnonzero(own.force[: own.count[0]] > 0.0)
    place = np.empty((len(used), 3))
    for x, c in zip(place, used):  # between both axes
        surface_point(orientation, position, own.section[c, 1], own.weight[c, 1, 0], own.arm[c, 1], x)
    place += own.apart[used, None] * own.normal[used]
    return Touches(own.force[used, None] * own.normal[used], place, -own.gap[used], np.full(len(used), ITSELF))
