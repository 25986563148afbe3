"""What is around the rod: walls, the surface that touches them, and what pushes it where it does."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gravcomp.scene import PlaneWall, SceneSection
from gravcomp.scene.scene import Scene
from gravcomp.virtual.contact import Walls
from gravcomp.virtual.contact_force import Touching, rigid_stiffness, surface_point
from gravcomp.virtual.rod import RodModel
from gravcomp.virtual.surface import RodSurface, rod_surface
from gravcomp.virtual.true_robot import TrueRobot

_DEPTH = 3e-5  # of the rod's length, by which the plane that stands for a wall may differ from it
# Fields of `SceneArrays` with an entry for each row.
_ROWS = ("obstacle", "kind", "rotation", "origin", "size", "sign", "first", "last", "closed", "stiffness", "friction")


@dataclass(frozen=True)
class RodSurroundings:
    """walls; surface of the rod; rigid: stiffness of a point on a rigid wall, N/m; depth: accuracy of the walls, m."""

    walls: Walls
    surface: RodSurface
    rigid: float
    depth: float

    @classmethod
    def of(cls, model: RodModel, true: TrueRobot, scene: Scene) -> "RodSurroundings":
        """Return a scene around a rod. Raises ConfigError for a body from a file that has no section somewhere."""
        walls = Walls(scene.turned(np.eye(3)), ~scene.in_world)
        return cls(walls, rod_surface(model, true), rigid_stiffness(model.stiffness, model.length), _DEPTH * model.length.sum())

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

    force (t, 3) N on the rod and place (t, 3) m, in the fixed frame; depth (t,) m in the wall; row (t,): of the obstacle.
    """

    force: np.ndarray
    place: np.ndarray
    depth: np.ndarray
    row: np.ndarray


def touches_of(touching: Touching, orientation: np.ndarray, position: np.ndarray) -> Touches:
    """Return the points of `touching` that a wall pushes, on a rod at orientation (n + 1, 3, 3) and position (n + 1, 3) m."""
    used = np.flatnonzero(touching.force[: touching.count[0]].any(axis=1))
    place = np.empty((len(used), 3))
    for x, c in zip(place, used):
        surface_point(orientation, position, touching.section[c], touching.weight[c, 0], touching.arm[c], x)
    return Touches(touching.force[used], place, -touching.gap[used], touching.row[used])
