"""Places where the robot touches something, and forces from outside as arrows.

An arrow ends where the force acts; where something pulls, it begins there. Its length is a share of a full scale that follows the
largest force of the last seconds in steps of 1, 2 and 5, so that it suits every robot; the force is written next to it.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.colours import Rgb
from gravcomp.view.plots import top_of
from gravcomp.view.scale import SCALE, scaled
from gravcomp.view.touches import Touch, force_text, resultants

_LONGEST = 0.45  # length of an arrow of full scale, in lengths of the robot
_SHORTEST = 0.06
_SMALLEST = 1e-4  # least full scale, as part of the largest tension of a cable
_KEPT = 10.0  # s for which the full scale keeps to the largest force
_LABELS = 4  # of each kind at most


class ForceScale:
    """The length of an arrow for a force."""

    def __init__(self, length: float, tension_max: float) -> None:
        """length: of the robot, m; tension_max: of its cables, N."""
        self._length, self._least = length, _SMALLEST * tension_max
        self._recent: list[tuple[float, float]] = []  # time, largest force
        self._top = self._least

    def follow(self, time: float, largest: float) -> None:
        """Take the largest force (N) at `time` (s)."""
        kept = [(t, size) for t, size in self._recent if 0.0 <= time - t <= _KEPT and size > largest]
        self._recent = [*kept, (time, largest)]
        self._top = top_of(np.array([size for _, size in self._recent]), self._top, self._least)

    def arrow(self, touch: Touch, pulls: bool = False) -> np.ndarray:
        """Return start and end (2, 3) in m of the arrow of a force that is not 0."""
        length = self._length * (_SHORTEST + (_LONGEST - _SHORTEST) * min(1.0, touch.size / self._top))
        way = length * touch.force / touch.size
        return np.array([touch.place, touch.place + way] if pulls else [touch.place - way, touch.place])


class ForceMarkers:
    """The forces of one kind in a scene: a point for each, an arrow and a label for each source."""

    def __init__(self, scene: viser.SceneApi, kind: str, colour: Rgb, radius: float, pulls: bool = False) -> None:
        """radius: of the robot, m; pulls: they pull."""
        self._pulls = pulls
        self._arrows = scene.add_arrows(
            f"/robot/{kind}_arrows", np.zeros((1, 2, 3)), colour, shaft_radius=SCALE * 0.14 * radius,
            head_radius=SCALE * 0.34 * radius, head_length=SCALE * 0.9 * radius, visible=False)  # fmt: skip
        self._points = scene.add_point_cloud(
            f"/robot/{kind}_points", np.zeros((1, 3), np.float32), colour, point_size=SCALE * 0.45 * radius,
            point_shape="circle", precision="float32", visible=False)  # fmt: skip
        self._colour = colour
        # The model's on the other side: its forces are often those on the virtual robot.
        anchor: Literal["top-left", "top-right"] = "top-left" if kind == "model" else "top-right"
        self._labels = [scene.add_label(f"/robot/{kind}_label{i}", "", visible=False, anchor=anchor) for i in range(_LABELS)]

    def show(self, touches: Sequence[Touch], scale: ForceScale) -> None:
        """Show these forces."""
        sums = [touch for touch in resultants(touches) if touch.size > 0.0]
        self._arrows.visible = bool(sums)
        self._points.visible = bool(touches)
        if touches:
            self._points.points = scaled(np.array([touch.place for touch in touches]))
            self._points.colors = np.tile(np.array(self._colour, np.uint8), (len(touches), 1))
        arrows = [scale.arrow(touch, self._pulls) for touch in sums]
        if sums:
            self._arrows.points = scaled(np.array(arrows))
        for index, label in enumerate(self._labels):
            label.visible = index < len(sums)
            if index < len(sums):
                label.text = f"{sums[index].source} {force_text(sums[index].size)}"
                label.position = SCALE * arrows[index][1 if self._pulls else 0]


class Forces:
    """All forces: of the model's walls, of what touches the virtual robot, of a hand, and the estimated load."""

    def __init__(self, scene: viser.SceneApi, length: float, radius: float, tension_max: float) -> None:
        """length, radius: of the robot, m; tension_max: of its cables, N."""
        self._scale = ForceScale(length, tension_max)
        self._markers = {
            "model": ForceMarkers(scene, "model", colours.BRAND, radius),
            "virtual": ForceMarkers(scene, "virtual", colours.TRUTH, radius),
            "hand": ForceMarkers(scene, "pull", colours.PLACED, radius, pulls=True),
            "load": ForceMarkers(scene, "load", colours.LOAD, radius),
        }

    def show(self, time: float, forces: dict[str, Sequence[Touch]]) -> None:
        """Show the forces of each kind ('model', 'virtual', 'hand', 'load') at `time` (s)."""
        everything = [touch.size for touches in forces.values() for touch in resultants(touches)]
        self._scale.follow(time, max(everything, default=0.0))
        for kind, markers in self._markers.items():
            markers.show(forces.get(kind, ()), self._scale)
