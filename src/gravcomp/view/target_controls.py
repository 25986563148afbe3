"""Controls of the target: two sliders, a button, and the handle in the scene that drags the tip."""

import math
from collections.abc import Callable

import numpy as np
import viser

from gravcomp.view.handles import number, set_value
from gravcomp.view.requests import Request, SetTarget
from gravcomp.view.scale import SCALE

_LARGEST_BEND = 120.0  # deg
_SMALLEST_BEND = math.radians(1.0)  # below it a bend has no plane


class TargetControls:
    """Sets the target of a robot of `length` (m); `put` receives the requests."""

    def __init__(
        self, gui: viser.GuiApi, gizmo: viser.TransformControlsHandle, length: float, put: Callable[[Request], None]
    ) -> None:
        self._gizmo, self._length, self._put = gizmo, length, put
        with gui.add_folder("Target"):
            self._angle = gui.add_slider(
                "bend °", min=0.0, max=_LARGEST_BEND, step=1.0, initial_value=0.0, hint="angle between base and tip direction"
            )
            self._plane = gui.add_slider(
                "plane °", min=-180.0, max=180.0, step=1.0, initial_value=0.0, hint="direction of the bend, from x"
            )
            straight = gui.add_button("Straight")
        self._angle.on_update(self._on_bend)
        self._plane.on_update(self._on_bend)
        gizmo.on_update(self._on_gizmo)
        straight.on_click(lambda _: self._set_bend(0.0, math.radians(number(self._plane))))

    def show_gizmo(self, visible: bool) -> None:
        """Show or hide the handle that drags the tip of the target."""
        self._place_gizmo(math.radians(number(self._angle)), math.radians(number(self._plane)))
        self._gizmo.visible = visible

    def _on_bend(self, event: viser.GuiEvent) -> None:
        if event.client is None:  # set by the program, not by the user
            return
        angle, plane = math.radians(number(self._angle)), math.radians(number(self._plane))
        self._place_gizmo(angle, plane)
        self._put(SetTarget(angle, plane))

    def _on_gizmo(self, event: viser.TransformControlsEvent) -> None:
        if event.client is None:
            return
        # The arc through the handle: its chord is inclined by half the bend.
        x, y, z = np.asarray(self._gizmo.position)
        angle = min(2.0 * math.atan2(math.hypot(x, y), z), math.radians(_LARGEST_BEND))
        plane = math.atan2(y, x) if angle > _SMALLEST_BEND else math.radians(number(self._plane))
        set_value(self._angle, round(math.degrees(angle), 1))
        set_value(self._plane, round(math.degrees(plane), 1))
        self._put(SetTarget(angle, plane))

    def _set_bend(self, angle: float, plane: float) -> None:
        set_value(self._angle, math.degrees(angle))
        set_value(self._plane, math.degrees(plane))
        self._place_gizmo(angle, plane)
        self._put(SetTarget(angle, plane))

    def _place_gizmo(self, angle: float, plane: float) -> None:
        from gravcomp.inverse.target import arc_points  # imports Numba

        self._gizmo.position = SCALE * arc_points(self._length, angle, plane, np.array([1.0]))[0]
