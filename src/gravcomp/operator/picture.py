"""The picture of a camera at the robot's tip, as far as a person steers by it: where the target is, and where the lumen goes on.

The picture is that of a pinhole. A place in it is given as the angles (2,) in rad by which it lies off the middle, along x and
y of the tip's section. What a wall hides is not seen: along the line of sight the scene has no free space there.
"""

from dataclasses import dataclass

import numpy as np

from gravcomp.scene.distance import SceneArrays, nearest_of_all

_SIGHTS = 40  # places along a line of sight at which it is looked for a wall


@dataclass(frozen=True)
class Picture:
    """Angles (2,) of the target, and those of the farthest place of the lumen that is seen; None where there is none."""

    target: np.ndarray | None
    ahead: np.ndarray | None

    @property
    def off_middle(self) -> float:
        """Angle (rad) of the target off the middle, infinite where it is not seen."""
        return np.inf if self.target is None else float(np.linalg.norm(self.target))


class Camera:
    """A camera whose lens is the middle of the tip's face; it sees half the angle `half_view` rad to every side."""

    def __init__(self, scene: SceneArrays, line: np.ndarray, half_view: float):
        """line (k, 3) m: the middle of the lumen, from its mouth inward; scene and line are in the same frame."""
        self._scene, self._line, self._half_view = scene, line, half_view

    def look(self, tip: np.ndarray, rotation: np.ndarray, target: np.ndarray) -> Picture:
        """Return the picture at the tip (3,) m with the axes `rotation` (3, 3); target (3,) m: a place next to a wall."""
        points = np.concatenate([target[None], self._line])
        angles = _angles(tip, rotation, points)
        seen = self._seen(tip, points, angles)
        ahead = np.flatnonzero(seen[1:])
        return Picture(
            angles[0] if seen[0] else None,
            angles[1 + ahead[-1]] if len(ahead) else None,
        )

    def _seen(self, tip: np.ndarray, points: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Whether each point (k, 3), at these angles (k, 2) in the picture, is within it and nothing hides it."""
        within = np.linalg.norm(angles, axis=1) < self._half_view
        chosen = np.flatnonzero(within)
        share = np.linspace(0.0, 1.0, _SIGHTS, endpoint=False)[1:]
        sights = tip + share[None, :, None] * (points[chosen] - tip)[:, None]
        gap = nearest_of_all(self._scene, sights.reshape(-1, 3))[0].reshape(len(chosen), _SIGHTS - 1)
        within[chosen] = (gap > 0.0).all(axis=1)
        return within


def _angles(tip: np.ndarray, rotation: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the places (k, 2) in the picture of points (k, 3)."""
    own = (points - tip) @ rotation
    across = np.linalg.norm(own[:, :2], axis=1)
    angle = np.arctan2(across, own[:, 2])
    direction = np.where(across[:, None] > 0.0, own[:, :2] / np.maximum(across, 1e-300)[:, None], [1.0, 0.0])
    return angle[:, None] * direction
