"""What is around the rod: walls, the surface that touches them, and what pushes it where it does."""

from dataclasses import dataclass

import numpy as np

from gravcomp.scene import SceneSection
from gravcomp.scene.scene import Scene
from gravcomp.virtual.contact import Walls
from gravcomp.virtual.contact_force import Touching, rigid_stiffness
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
    def none(cls) -> "RodSurroundings":
        """Return surroundings without walls."""
        scene = Scene(SceneSection())
        return cls(Walls(scene.arrays, ~scene.in_world), RodSurface.none(), 1.0, 1.0)


@dataclass(frozen=True)
class Touches:
    """Places where walls push a rod, t of them: force (t, 3) N on the rod, in the fixed frame; depth (t,) m in the wall."""

    force: np.ndarray
    depth: np.ndarray


def touches_of(touching: Touching) -> Touches:
    """Return the points of `touching` that a wall pushes."""
    used = np.flatnonzero(touching.force[: touching.count[0]].any(axis=1))
    return Touches(touching.force[used], -touching.gap[used])
