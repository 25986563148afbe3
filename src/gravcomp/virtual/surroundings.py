"""What is around the rod: walls, the surface that touches them, and the places where it does."""

from dataclasses import dataclass

import numpy as np

from gravcomp.scene import SceneSection
from gravcomp.scene.scene import Scene
from gravcomp.virtual.contact import Walls
from gravcomp.virtual.contact_force import Touching, rigid_stiffness, surface_point
from gravcomp.virtual.rod import RodModel
from gravcomp.virtual.surface import RodSurface, rod_surface
from gravcomp.virtual.true_robot import TrueRobot

_DEPTH = 3e-5  # of the rod's length, by which the plane that stands for a wall may differ from it


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
    def none(cls, model: RodModel) -> "RodSurroundings":
        """Return surroundings without walls."""
        scene = Scene(SceneSection())
        return cls(Walls(scene.arrays, ~scene.in_world), RodSurface.none(), 1.0, 1.0)


@dataclass(frozen=True)
class Touches:
    """Places where a rod touches walls: t of them, in the fixed frame.

    place (t, 3) m; force (t, 3) N, on the rod; depth (t,) m in the wall; obstacle (t,) int: its number in the scene; element (t,)
    int: the element that it is on.
    """

    place: np.ndarray
    force: np.ndarray
    depth: np.ndarray
    obstacle: np.ndarray
    element: np.ndarray

    @property
    def total(self) -> float:
        """Sum of the sizes of the forces, N."""
        return float(np.linalg.norm(self.force, axis=1).sum())


def touches_of(touching: Touching, walls: Walls, orientation: np.ndarray, position: np.ndarray) -> Touches:
    """Return the points of `touching` that a wall pushes, with the rod at orientation (n + 1, 3, 3) and position (n + 1, 3)."""
    used = np.flatnonzero(touching.force[: touching.count[0]].any(axis=1))
    place = np.empty((len(used), 3))
    for row, c in enumerate(used):
        surface_point(orientation, position, touching.section[c], touching.weight[c, 0], touching.arm[c], place[row])
    return Touches(
        place,
        touching.force[used].copy(),
        -touching.gap[used],
        walls.scene.obstacle[touching.row[used]],
        touching.section[used].copy(),
    )
