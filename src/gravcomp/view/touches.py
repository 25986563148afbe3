"""Forces from outside, as the page shows them."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.scene.declared import ITSELF

if TYPE_CHECKING:
    from gravcomp.scene.scene import Scene

HAND = "hand"
"""Source of a hand's force on the virtual robot, in the message VirtualForces as well."""


@dataclasses.dataclass(frozen=True)
class Touch:
    """A force (3,) N on the robot at a place (3,) m, both in soft_base; source: name of what pushes there."""

    source: str
    place: np.ndarray
    force: np.ndarray

    @property
    def size(self) -> float:
        """Size of the force, N."""
        return float(np.linalg.norm(self.force))


def model_touches(
    scene: "Scene",
    gravity: np.ndarray,
    obstacles: Sequence[str],
    sizes: Sequence[float] | np.ndarray,
    places: np.ndarray,
    backbone: np.ndarray,
) -> tuple[Touch, ...]:
    """Return the normal forces of obstacles on the model.

    gravity (3,) in soft_base; sizes (o,) N; places (o, 3) m: of the largest force of each obstacle, where its normal is taken;
    backbone (n, 3) m: where the robot touches itself, the force on the part whose backbone is nearer is shown, toward that.
    """
    normals = scene.nearest(places, scene.under_gravity(gravity))[1]
    for index, name in enumerate(obstacles):
        if name == ITSELF:
            normals[index] = _toward(backbone, places[index])
    return tuple(Touch(name, place, size * normal) for name, place, size, normal in zip(obstacles, places, sizes, normals))


def _toward(backbone: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the direction (3,) from a place (3,) to the nearest one on the lines between the points (n, 3) of a backbone."""
    start, way = backbone[:-1], np.diff(backbone, axis=0)
    share = np.clip(((place - start) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-300), 0.0, 1.0)
    nearest = start + share[:, None] * way - place
    nearest = nearest[np.argmin((nearest**2).sum(axis=1))]
    return nearest / max(float(np.linalg.norm(nearest)), 1e-300)


def resultants(touches: Sequence[Touch]) -> list[Touch]:
    """Return one force for each source: the sum, at the mean of the places weighted by the forces."""
    found = []
    for source in dict.fromkeys(touch.source for touch in touches):
        own = [touch for touch in touches if touch.source == source]
        weight = np.array([touch.size for touch in own])
        if weight.sum() > 0.0:
            place = weight @ np.array([touch.place for touch in own]) / weight.sum()
            found.append(Touch(source, place, np.sum([touch.force for touch in own], axis=0)))
    return found


def force_text(size: float) -> str:
    """Return a force (N) with two digits: in mN below 0.1 N."""
    return f"{1e3 * size:.2g} mN" if size < 0.0995 else f"{size:.2g} N" if size < 99.5 else f"{size:.0f} N"
