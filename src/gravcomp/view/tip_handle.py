"""The ball at the virtual robot's tip that the user drags: a spring pulls the tip to the cursor."""

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.in_base import BaseFrame
from gravcomp.view.requests import Push
from gravcomp.view.scale import SCALE, scaled

_BALL = 0.8  # radius over the robot's


class TipHandle:
    """Only a virtual robot has it: no mouse pushes a real one. The browser that took hold first keeps it until it lets go."""

    def __init__(self, scene: viser.SceneApi, frame: BaseFrame, radius: float) -> None:
        """radius: of the robot, m."""
        self._frame = frame
        self._held: tuple[int, np.ndarray] | None = None  # browser, place of the cursor in soft_base
        self._announced = False
        self._ball = scene.add_icosphere(
            "/robot/hand", SCALE * _BALL * radius, color=colours.PLACED, cast_shadow=False, visible=False
        )
        self._spring = scene.add_line_segments(
            "/robot/spring", np.zeros((1, 2, 3)), colours.PLACED, thickness=SCALE * 0.25 * radius, visible=False
        )
        self._ball.on_drag("left")(self._on_drag)

    async def _on_drag(self, event: viser.SceneNodeDragEvent) -> None:
        # Not a plain function: viser calls these in order.
        if event.phase == "end":
            self.let_go(event.client_id)
        elif self._ball.visible and (self._held is None or self._held[0] == event.client_id):
            self._held = event.client_id, self._frame.place(event.end_position)

    def let_go(self, browser: int) -> None:
        """Let go if this browser holds the tip."""
        if self._held is not None and self._held[0] == browser:
            self._held = None

    def drop(self) -> None:
        """Let go, in whatever browser the tip is held."""
        self._held = None

    def request(self) -> Push | None:
        """Return where the tip is held now, once more that it is released, or None."""
        held = self._held
        if held is None:
            released, self._announced = self._announced, False
            return Push(None) if released else None
        self._announced = True
        return Push((float(held[1][0]), float(held[1][1]), float(held[1][2])))

    def show(self, tip: np.ndarray | None) -> None:
        """Show the handle at the tip (3,) m; None: without a handle."""
        if tip is None:
            self._held = None
        held = self._held
        self._ball.visible = tip is not None
        self._spring.visible = held is not None and bool(np.isfinite(held[1]).all())
        if tip is not None:
            self._ball.position = SCALE * tip
            if held is not None and self._spring.visible:
                self._spring.points = scaled(np.array([[tip, held[1]]]))
