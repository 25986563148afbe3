"""Scenes in which a robot cannot be: its base is inside an obstacle, or a lumen or two walls leave less room than it needs."""

from collections.abc import Iterator

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.contact.outline_gap import deepest
from gravcomp.contact.own_surface import own_surface
from gravcomp.contact.surface import contact_surface
from gravcomp.description import Robot
from gravcomp.scene.distance import PLANE, TUBE, SceneArrays, gap_to
from gravcomp.scene.scene import Scene

# Of the radius: a base that is deeper in an obstacle is refused.
_TOUCHING = 1e-2
# Of two planes whose normals differ from opposite ones by less, in rad: they are parallel.
_PARALLEL = 1e-3


def refuse_start(scene: Scene, robot: Robot) -> None:
    """Raise ConfigError where the base is inside an obstacle of soft_base, or where there is less room than the robot needs.

    Room is that of a lumen, or of two planes that face each other. Raises ConfigError, too, where a robot that touches itself has
    sections that are not round.

    Raises ValueError for a robot that has no outlines along its axis.
    """
    surface, arrays = contact_surface(robot), scene.arrays
    if scene.self_contact:
        try:
            own_surface(robot, surface)
        except ValueError as error:
            raise ConfigError(f"{scene.source}: scene.self_contact: {error}") from error
    base = np.vstack([np.zeros(3), np.eye(3)[:2]])
    thinnest = float(surface.radius.min())
    own, normal = np.zeros(2), np.zeros(3)
    for one, other, width in _facing(arrays, scene.in_world):
        if width < 2.0 * thinnest:
            first, second = (scene.names[arrays.obstacle[row]] for row in (one, other))
            between = f"'{first}'" if first == second else f"'{first}' and '{second}'"
            raise ConfigError(
                f"{scene.source}: scene: between the walls of {between} there are {1e3 * max(width, 0.0):.3g} mm;"
                f" the robot needs more than its diameter, {2e3 * thinnest:g} mm"
            )
    for row in range(len(arrays.kind)):
        name = scene.names[arrays.obstacle[row]]
        if arrays.kind[row] == TUBE and arrays.sign[row] < 0.0:
            narrowest = float(arrays.samples[arrays.first[row] : arrays.last[row], :, 3].min())
            if narrowest < thinnest:
                raise ConfigError(
                    f"{scene.source}: scene: the radius of '{name}' is {1e3 * narrowest:.3g} mm at its narrowest place;"
                    f" the robot needs more than its own, {1e3 * thinnest:g} mm"
                )
        middle = np.zeros(3)
        inside = -gap_to(arrays, row, base[0], middle)
        # What is in the world turns about the middle of the base, which alone is at the same place in it then.
        depth = inside if scene.in_world[row] else -deepest(arrays, row, surface, 0, base, own, normal)
        if scene.in_world[row] or inside > depth:  # the obstacle is smaller than the robot
            depth, normal = inside, middle
        if depth > _TOUCHING * surface.radius[0]:
            way = ", ".join(f"{1e3 * depth * x:+.3g}" for x in normal)
            raise ConfigError(
                f"{scene.source}: scene: the robot starts {1e3 * depth:.3g} mm inside '{name}', where it is clamped;"
                f" move the obstacle by at least that (the robot's shortest displacement that frees it is {way} mm)"
            )


def _facing(arrays: SceneArrays, in_world: np.ndarray) -> Iterator[tuple[int, int, float]]:
    """Yield the rows of two planes that face each other in the same frame, and the width between them in m."""
    planes = np.flatnonzero(arrays.kind == PLANE)
    for i, one in enumerate(planes):
        for other in planes[i + 1 :]:
            normal, against = arrays.rotation[one][:, 2], arrays.rotation[other][:, 2]
            if in_world[one] == in_world[other] and float(np.linalg.norm(normal + against)) < _PARALLEL:
                yield int(one), int(other), float(normal @ (arrays.origin[other] - arrays.origin[one]))
