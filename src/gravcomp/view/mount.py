"""The fixed parts behind the robot's base: flange, housing, one motor per cable, and the IMU board."""

import math

import numpy as np
import viser

from gravcomp.view import colours
from gravcomp.view.scale import SCALE
from gravcomp.view.skin import revolved

# The profiles are drawn for a mount of this size.
_NOMINAL_SIZE = 0.018  # m


class Mount:
    """Adds the mount to a scene; size: m, twice the robot's diameter."""

    def __init__(self, scene: viser.SceneApi, size: float, motors: int) -> None:
        self._scene, self._unit = scene, size / _NOMINAL_SIZE
        self._add_turned(
            "flange", [(0, 0), (7, 0), (8, -1), (8, -6), (22, -8), (23, -9), (23, -12), (22, -13), (0, -13)], colours.METAL
        )
        self._add_turned("core", [(0, -13), (9, -13), (9, -42), (0, -42)], (58, 64, 74))
        self._add_turned("plate", [(0, -42), (22, -42), (23, -43), (23, -46), (22, -47), (0, -47)], colours.METAL)
        self._add_turned("handle", [(0, -47), (9, -47), (10.5, -49), (9.5, -62), (10.5, -80), (8, -84), (0, -84)], (52, 58, 68))
        motor = [(0, -14), (4.6, -14), (5, -14.6), (5, -41), (0, -41)]
        for i in range(motors):
            angle = 2 * math.pi * i / motors
            self._add_turned(f"motor{i}", motor, (176, 184, 196), 16.0, angle, around=20)
        scene.add_box(
            "/robot/mount/board",
            color=colours.BOARD,
            dimensions=SCALE * self._unit * 1e-3 * np.array([14.0, 18.0, 1.6]),
            position=(0.0, -SCALE * self._unit * 0.012, -SCALE * self._unit * 0.0072),
            wxyz=(0.9659, 0.2588, 0.0, 0.0),
        )

    def _add_turned(
        self,
        name: str,
        profile_mm: list[tuple[float, float]],
        colour: colours.Rgb,
        away_mm: float = 0.0,
        angle: float = 0.0,
        around: int = 36,
    ) -> None:
        """Add a turned part: profile (radius, z) in mm from front to back, axis `away_mm` from z at `angle` (rad)."""
        radii, heights = _with_sharp_corners(1e-3 * self._unit * np.array(profile_mm, float)[::-1])
        part = revolved(radii, heights, 1.0, around)
        vertices = np.column_stack([part.offset, part.station])
        away = SCALE * 1e-3 * self._unit * away_mm
        position = (away * math.cos(angle), away * math.sin(angle), 0.0)
        self._scene.add_mesh_simple(
            f"/robot/mount/{name}", SCALE * vertices, part.faces, color=colour, position=position, side="front"
        )


def _with_sharp_corners(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return radii and heights with points added near each corner, so that smooth shading keeps the edges."""
    points = [profile[0]]
    for a, b in zip(profile, profile[1:]):
        points += [a + 0.04 * (b - a), a + 0.96 * (b - a), b]
    radii, heights = np.array(points).T
    return radii, heights
