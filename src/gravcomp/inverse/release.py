"""Letting go of obstacles that the robot lies on while its target is in free space.

The response holds what touches: it has no motion off an obstacle, so that a robot which lies on one seems to be at the shape
nearest to its target. Where the target is on the free side of an obstacle, at d = n . (target - tip) > 0 along its normal n, the
programme has in addition the error

    d (F + F' . (lambda - lambda_now) + F_0) / F_0,

F: force on the obstacle, F': its change by the tensions, F_0: the largest force since the robot lies there. The force counts like
the way that is left to the target: the cables take it over, and a little more, so that the robot lifts off. The next response is
that of a free robot.
"""

from typing import NamedTuple

import numpy as np

from gravcomp.contact.contacts import ObstacleForces
from gravcomp.scene.scene import Scene


class ReleaseErrors(NamedTuple):
    """Errors change @ lambda + offset in m of f obstacles: change (f, m) in m/N, offset (f,) in m."""

    change: np.ndarray
    offset: np.ndarray

    @staticmethod
    def none(cables: int) -> "ReleaseErrors":
        """Return no errors, for a number of cables."""
        return ReleaseErrors(np.zeros((0, cables)), np.zeros(0))


class Release:
    """Remembers the largest force on each obstacle, from step to step."""

    def __init__(self) -> None:
        self._largest: dict[str, float] = {}

    def forget(self) -> None:
        """Forget the forces: the robot lies on nothing that keeps it from its target."""
        self._largest = {}

    def errors(
        self, scene: Scene, forces: ObstacleForces, tension: np.ndarray, way: np.ndarray, gravity: np.ndarray | None
    ) -> ReleaseErrors:
        """Return the errors of the obstacles of which the target is on the free side.

        tension (m,) in N: present ones; way (3,): from the tip to its target in m; gravity (3,) in m/s^2 places what is in the
        world, None: the horizontal robot.
        """
        walls = np.array([name in scene.names for name in forces.names], dtype=bool)  # all but the robot itself
        forces = ObstacleForces(
            tuple(name for name in forces.names if name in scene.names),
            forces.force[walls], forces.position[walls], forces.change[walls],
        )  # fmt: skip
        if not len(forces):
            self.forget()
            return ReleaseErrors.none(len(tension))
        self._largest = {name: max(force, self._largest.get(name, 0.0)) for name, force in zip(forces.names, forces.force)}
        _, normal, _ = scene.nearest(forces.position, None if gravity is None else scene.under_gravity(gravity))
        left, largest = normal @ way, np.array(list(self._largest.values()))
        chosen = (left > 0.0) & (largest > 0.0)
        left, largest = left[chosen], largest[chosen]
        change = (left / largest)[:, None] * forces.change[chosen]
        return ReleaseErrors(change, left * (forces.force[chosen] / largest + 1.0) - change @ tension)
