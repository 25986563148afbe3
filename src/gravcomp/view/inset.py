"""The picture of the camera at the tip as an inset of the page."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.backbone import rotation_from_wxyz
from gravcomp.view.plane_patch import patch_side, plane_foot, plane_patch, plane_wxyz
from gravcomp.view.snapshot import Snapshot

if TYPE_CHECKING:
    from gravcomp.view.obstacle_shapes import ObstacleShape
    from gravcomp.view.tip_camera import Surface, TipCamera

_SIZE = 200  # px
_WIDTH, _HEIGHT = 232, 288  # px, of the panel
_MARGIN = 14  # px
_REACH = 0.5  # of the robot's length: where the camera's light has fallen to a half


class Inset:
    """A panel over the scene. It is there while there is something to see: obstacles, or a wall that the user has placed."""

    def __init__(self, gui: viser.GuiApi, shapes: "Sequence[ObstacleShape]", length: float, radius: float) -> None:
        """shapes: the obstacles; length, radius: of the robot, m."""
        self._shapes, self._length, self._radius = shapes, length, radius
        self._camera: TipCamera | None = None
        self._wanted = True
        self._panel = gui.add_panel(visible=False)
        with self._panel.add_tab("Camera at the tip"):
            self._image = gui.add_image(np.zeros((_SIZE, _SIZE, 3), np.uint8), format="jpeg", jpeg_quality=85)
        self._panel.float(x=_MARGIN, y=-_MARGIN, width=_WIDTH, height=_HEIGHT)

    def show_panel(self, wanted: bool) -> None:
        """Show or hide the panel."""
        self._wanted = wanted

    def show(self, snapshot: Snapshot) -> None:
        """Show what the camera sees: at the virtual robot's tip where there is one, else at the model's."""
        body = snapshot.truth or snapshot.backbone
        there = self._wanted and body is not None and bool(self._shapes or snapshot.wall is not None)
        if self._panel.visible != there:
            self._panel.visible = there
        if not there or body is None:
            return
        if self._camera is None:
            from gravcomp.view.tip_camera import TipCamera  # imports Numba

            self._camera = TipCamera(_SIZE, _REACH * self._length)
        (tip,), (rotation,) = body.at(np.array([1.0]))
        target = snapshot.target.tip if snapshot.target is not None else None
        if target is not None and np.linalg.norm(target - tip) < self._radius:
            target = None  # the camera is there
        self._image.image = self._camera.picture(self._surfaces(snapshot), tip, rotation, target)

    def _surfaces(self, snapshot: Snapshot) -> "list[Surface]":
        surfaces: list[Surface] = []
        turn = np.eye(3)
        if snapshot.gravity is not None and any(shape.in_world for shape in self._shapes):
            from gravcomp.scene.world_axes import world_rotation  # imports Numba

            turn = world_rotation(snapshot.gravity)
        for shape in self._shapes:
            vertices = shape.vertices @ turn if shape.in_world else shape.vertices
            surfaces.append((vertices, shape.faces, colours.ZONE if shape.forbidden else colours.TISSUE))
        if snapshot.wall is not None:
            point, normal = snapshot.wall
            vertices, faces = plane_patch(patch_side(self._length))
            foot = plane_foot(normal, point, np.array([0.0, 0.0, self._length / 2]))
            vertices = vertices @ rotation_from_wxyz(plane_wxyz(normal)).T + foot
            surfaces.append((vertices, faces, colours.PLACED))
        return surfaces
