"""Markers around the robot: the ground truth of the virtual robot, and the target with its handle."""

import math

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.backbone import Backbone
from gravcomp.view.drawn_skin import add_skin
from gravcomp.view.scale import SCALE, scaled
from gravcomp.view.skin import line_skin
from gravcomp.view.snapshot import TargetView


class TruthMarker:
    """A line along the true backbone and a sphere at its tip; radius: m, of the robot."""

    def __init__(self, scene: viser.SceneApi, straight: Backbone, radius: float) -> None:
        self._skin = line_skin(0.3 * radius)
        self._line = add_skin(scene, "/robot/truth", self._skin, straight, colours.TRUTH, cast_shadow=False)
        self._tip = scene.add_icosphere("/robot/truth_tip", SCALE * 0.42 * radius, color=colours.TRUTH, cast_shadow=False)
        self._line.visible = self._tip.visible = False

    def show(self, truth: Backbone | None) -> None:
        """Show the backbone; None hides the marker."""
        self._line.visible = self._tip.visible = truth is not None
        if truth is not None:
            self._line.vertices = scaled(self._skin.on(truth))
            self._tip.position = SCALE * truth.tip


class TargetMarker:
    """A ring at the target's tip, and a line where the target gives the whole shape.

    `gizmo` is the handle that drags the tip. radius: m, of the robot.
    """

    def __init__(self, scene: viser.SceneApi, straight: Backbone, radius: float) -> None:
        self._shown: TargetView | None = None
        self._skin = line_skin(0.07 * radius)
        self._line = add_skin(scene, "/robot/target", self._skin, straight, colours.TARGET, cast_shadow=False)
        angle = np.linspace(0.0, 2 * math.pi, 49)
        circle = 1.5 * radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        self._ring = scene.add_line_segments(
            "/robot/target_ring", SCALE * np.stack([circle[:-1], circle[1:]], axis=1), colours.TARGET, thickness=SCALE * 0.0006
        )
        self.gizmo = scene.add_transform_controls(
            "/robot/target_handle", scale=SCALE * 0.022, line_width=2.0, disable_rotations=True, disable_sliders=True,
            depth_test=False, opacity=0.85, position=SCALE * straight.tip, visible=False)  # fmt: skip

    def show(self, target: TargetView | None) -> None:
        """Show the target; None hides the marker."""
        curve = None if target is None else target.curve
        self._ring.visible, self._line.visible = target is not None, curve is not None
        if target is None or target is self._shown:
            return
        self._shown = target
        self._ring.position = SCALE * target.tip
        if curve is not None:
            self._line.vertices = scaled(self._skin.on(curve))
            x, y, z, w = curve.orientation[-1]
            self._ring.wxyz = (w, x, y, z)
