"""The wall that the user puts next to the virtual robot: dragged along its normal, and turned by rings.

It is drawn where the virtual robot has it. The model does not know it, and the page says so: the controller must do no harm at
such a wall.
"""

from collections.abc import Callable

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.backbone import rotation_from_wxyz
from gravcomp.view.in_base import BaseFrame
from gravcomp.view.plane_patch import patch_side, plane_foot, plane_patch, plane_wxyz
from gravcomp.view.requests import PlaceWall, Request
from gravcomp.view.scale import SCALE, scaled
from gravcomp.view.snapshot import Snapshot

SIDES = ("below", "above", "side", "ahead")
_GAP = 0.08  # between a new wall and the robot, in lengths of the robot
_TEXT = "unknown wall: the model does not know it"

_Plane = tuple[np.ndarray, np.ndarray]  # point (3,) m, unit normal (3,)


class WallHandle:
    """Draws the placed wall and lets the user move it; `put` receives the requests."""

    def __init__(self, scene: viser.SceneApi, frame: BaseFrame, length: float, radius: float) -> None:
        """length, radius: of the robot, m."""
        self._frame, self._length, self._radius = frame, length, radius
        self.put: Callable[[Request], None] = lambda _: None
        self._snapshot: Snapshot | None = None  # live, of a virtual robot
        self._grabbed: tuple[int, np.ndarray, _Plane] | None = None  # browser, place, the wall then
        vertices, faces = plane_patch(patch_side(length))
        self._patch = scene.add_mesh_simple(
            "/robot/placed_wall", scaled(vertices), faces, color=colours.PLACED, opacity=0.35, side="double",
            cast_shadow=False, visible=False)  # fmt: skip
        edge = patch_side(length) / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]], float)
        scene.add_line_segments(
            "/robot/placed_wall/edge", scaled(np.stack([edge[:-1], edge[1:]], axis=1)), colours.PLACED, thickness=SCALE * 0.0006
        )
        scene.add_label("/robot/placed_wall/text", _TEXT, position=SCALE * edge[0], anchor="bottom-right")
        self._rings = scene.add_transform_controls(
            "/robot/placed_wall_rings", scale=SCALE * 0.22 * length, disable_axes=True, disable_sliders=True,
            depth_test=False, opacity=0.85, visible=False)  # fmt: skip
        self._turning = False
        self._turned_by: int | None = None  # browser
        self._patch.on_drag("left")(self._on_drag)
        self._rings.on_update(self._on_turn)

    def put_up(self, side: str) -> None:
        """Put a wall on a side of SIDES, a little away from the robot as it is now."""
        snapshot = self._snapshot
        if snapshot is None or snapshot.truth is None or side not in SIDES:
            return
        normal = self._normal(side, snapshot)
        offset = float((snapshot.truth.position @ normal).min()) - self._radius - _GAP * self._length
        self._want(offset * normal, normal)

    def take_away(self) -> None:
        """Take the wall away."""
        self._grabbed = self._turned_by = None
        self.put(PlaceWall(None))

    def show_rings(self, visible: bool) -> None:
        """Show or hide the rings that turn the wall."""
        self._turning = visible

    def let_go(self, browser: int) -> None:
        """Let go if this browser drags or turns the wall."""
        if self._grabbed is not None and self._grabbed[0] == browser:
            self._grabbed = None
        if self._turned_by == browser:
            self._turned_by = None

    def show(self, snapshot: Snapshot, live: bool) -> None:
        """Draw the wall of a snapshot; live: it can be moved."""
        self._snapshot = snapshot if live and snapshot.virtual else None
        plane = snapshot.wall
        self._patch.visible = plane is not None
        self._rings.visible = plane is not None and self._turning and self._snapshot is not None
        if not self._rings.visible:
            self._turned_by = None
        if plane is None:
            return
        foot = plane_foot(plane[1], plane[0], np.array([0.0, 0.0, self._length / 2]))
        self._patch.position, self._patch.wxyz = SCALE * foot, plane_wxyz(plane[1])
        self._rings.position = SCALE * foot
        if self._turned_by is None:  # else the wall follows the rings, at its own speed
            self._rings.wxyz = plane_wxyz(plane[1])

    def _normal(self, side: str, snapshot: Snapshot) -> np.ndarray:
        axis, up = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
        if snapshot.gravity is not None and np.linalg.norm(snapshot.gravity) > 0.0:
            up = -snapshot.gravity / np.linalg.norm(snapshot.gravity)
        if side == "ahead":
            return -axis
        if side != "side":
            return up if side == "below" else -up
        across = np.cross(axis, up)
        return across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-3 else np.array([1.0, 0.0, 0.0])

    def _want(self, point: np.ndarray, normal: np.ndarray) -> None:
        """Ask for a wall, moved out of the robot's base where it would cut it."""
        if np.isfinite(point).all() and np.isfinite(normal).all():
            largest = -self._radius * float(np.hypot(normal[0], normal[1]))
            point = point + min(0.0, largest - float(normal @ point)) * normal
        self.put(PlaceWall((_triple(point), _triple(normal))))

    async def _on_drag(self, event: viser.SceneNodeDragEvent) -> None:
        # Not a plain function: viser calls these in order.
        if event.phase == "end":
            self.let_go(event.client_id)
        elif self._snapshot is None or self._snapshot.wall is None:
            return
        elif event.phase == "start" and self._grabbed is None:
            self._grabbed = event.client_id, self._frame.place(event.start_position), self._snapshot.wall
        if self._grabbed is not None and self._grabbed[0] == event.client_id:
            _, start, (point, normal) = self._grabbed
            way = float((self._frame.place(event.end_position) - start) @ normal)
            self._want(point + way * normal, normal)

    async def _on_turn(self, event: viser.TransformControlsEvent) -> None:
        # Not a plain function, as above.
        if event.phase == "end" and event.client_id is not None:
            self.let_go(event.client_id)
        if event.client is None or event.phase == "end" or self._snapshot is None or self._snapshot.wall is None:
            return
        self._turned_by = event.client_id
        if event.phase == "start":
            return
        self._want(np.asarray(self._rings.position, dtype=float) / SCALE, rotation_from_wxyz(self._rings.wxyz)[:, 2])


def _triple(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
