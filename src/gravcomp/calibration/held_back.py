"""How friction inside the material holds a tip back: hysteresis that does not depend on time.

A body under a changing load first bends against all of its friction, as if it were stiffer by the share s, and less where the
friction slips. Its tip stays behind the equilibrium x without friction by s z, with the stop operator (M. A. Krasnosel'skii,
A. V. Pokrovskii, Systems with Hysteresis, 1989; one element of W. D. Iwan, J. Appl. Mech. 34, 1967)

    z_k = z_(k-1) + x_k - x_(k-1), shortened to the length r;    z the mean of such operators with r / 2, r and 2 r

because a robot bends unevenly, and its sections slip one after the other. r is how far the tip comes when even bending brings
the outer fibre to the strain e at which the class of the material slips: r = e / h L^2 / 2, h half the width at the clamp; its
direction turns by 2 r / L. Without it, branches of creep that outlast a rest stand for what a robot keeps of the poses before,
and moduli for what they then lack.
"""

from collections.abc import Sequence

import numpy as np

from gravcomp.calibration.walk import Step
from gravcomp.description import Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.materials.material_classes import class_of

_SPREAD = (0.5, 1.0, 2.0)  # of r


def reach_of(robot: Robot, model: RobotModel) -> float:
    """Return r in m."""
    half = float(np.abs(model.mesh.nodes[model.mesh.clamped, :2]).max())
    return class_of(robot.materials[0].youngs_modulus).slip_strain / half * robot.length**2 / 2.0


def held_back(steps: Sequence[Step], reach: float, length: float) -> np.ndarray:
    """Return z (k, 6) of the tips, position in m and direction, in the steps that have a window.

    reach: r in m; length of the robot in m. A step without a duration is relaxed: nothing holds it back.
    """
    parts = np.zeros((len(_SPREAD), 2, 3))  # of the operators, position and direction
    most = reach * np.outer(_SPREAD, [1.0, 2.0 / length])[:, :, None]
    found, last = [], np.zeros(6)
    for step in steps:
        parts = np.zeros_like(parts) if step.duration is None else parts + (step.tip - last).reshape(2, 3)
        parts = parts * np.minimum(1.0, most / np.maximum(np.linalg.norm(parts, axis=2, keepdims=True), 1e-12))
        last = step.tip
        if step.window is not None:
            found.append(parts.mean(axis=0).ravel())
    return np.array(found)
