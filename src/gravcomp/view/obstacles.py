"""The obstacles of a robot's scene, half transparent, and its forbidden zones in another colour."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.scale import scaled

if TYPE_CHECKING:
    from gravcomp.view.obstacle_shapes import ObstacleShape

_OPACITY = 0.3


class Obstacles:
    """Draws obstacles; those of the world keep their place when the base turns. Attribute in_world: whether there are such."""

    def __init__(self, scene: viser.SceneApi, shapes: "Sequence[ObstacleShape]") -> None:
        self.in_world = any(shape.in_world for shape in shapes)
        self._world = scene.add_frame("/robot/world", show_axes=False)
        self._handles: list[viser.MeshHandle] = []
        for index, shape in enumerate(shapes):
            self._handles.append(
                scene.add_mesh_simple(
                    f"/robot/{'world/' if shape.in_world else ''}obstacle{index}",
                    scaled(shape.vertices),
                    shape.faces,
                    color=colours.ZONE if shape.forbidden else colours.WALL,
                    opacity=_OPACITY,
                    side="double",
                    cast_shadow=False,
                )
            )

    def set_visible(self, visible: bool) -> None:
        """Show or hide the obstacles."""
        for handle in (self._world, *self._handles):
            handle.visible = visible

    def turn(self, world_wxyz: np.ndarray) -> None:
        """Turn the world to the rotation (4,), w x y z, of the world in soft_base."""
        self._world.wxyz = world_wxyz
