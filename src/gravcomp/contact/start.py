"""Scenes in which a robot cannot be: its base is inside an obstacle, or a lumen is narrower than the robot."""

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.contact.places import deepest
from gravcomp.contact.surface import contact_surface
from gravcomp.description import Robot
from gravcomp.scene.distance import TUBE, gap_to
from gravcomp.scene.scene import Scene

# Of the radius: a base that is deeper in an obstacle is refused.
_TOUCHING = 1e-2


def refuse_start(scene: Scene, robot: Robot) -> None:
    """Raise ConfigError where the clamped base is inside an obstacle of soft_base, or a lumen is narrower than the robot.

    Raises ValueError for a robot that has no outlines along its axis.
    """
    surface, arrays = contact_surface(robot), scene.arrays
    base = np.vstack([np.zeros(3), np.eye(3)[:2]])
    thinnest = float(surface.radius.min())
    own, normal = np.zeros(2), np.zeros(3)
    for row in range(len(arrays.kind)):
        name = scene.names[arrays.obstacle[row]]
        if arrays.kind[row] == TUBE and arrays.sign[row] < 0.0:
            narrowest = float(arrays.samples[arrays.first[row] : arrays.last[row], :, 3].min())
            if narrowest < thinnest:
                raise ConfigError(
                    f"{scene.source}: scene: the radius of '{name}' is {1e3 * narrowest:.3g} mm at its narrowest place;"
                    f" the robot needs more than its own, {1e3 * thinnest:g} mm"
                )
        if scene.in_world[row]:
            continue  # it turns with the base
        depth, middle = -deepest(arrays, row, surface, 0, base, own, normal), np.zeros(3)
        inside = -gap_to(arrays, row, base[0], middle)
        if inside > depth:  # the obstacle is smaller than the robot
            depth, normal = inside, middle
        if depth > _TOUCHING * surface.radius[0]:
            way = ", ".join(f"{1e3 * depth * x:+.3g}" for x in normal)
            raise ConfigError(
                f"{scene.source}: scene: the robot starts {1e3 * depth:.3g} mm inside '{name}', where it is clamped;"
                f" move the obstacle by at least that (the robot's shortest displacement that frees it is {way} mm)"
            )
