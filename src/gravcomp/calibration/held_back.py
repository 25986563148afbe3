"""How friction inside the material holds a tip back: hysteresis that does not depend on time.

A body under a changing load first bends against all of its friction, as if it were stiffer by the share s, and less where the
friction slips. Its tip stays behind the equilibrium x without friction by s z, with the stop operator (M. A. Krasnosel'skii,
A. V. Pokrovskii, Systems with Hysteresis, 1989; one element of W. D. Iwan, J. Appl. Mech. 34, 1967)

    z_k = z_(k-1) + x_k - x_(k-1), shortened to a length;    z the mean of three such operators

because a robot bends unevenly, and its sections slip one after the other. x is the way of the measured tip, all of it: a robot
that swings past its rest and back, as a soft one does after each move, loses most of what the friction held, and from rest to
rest nothing of that shows.

A cantilever that its own weight bends has the curvature c (1 - u)^2 at the share u of its length L, which moves its tip by
c L^2 / 4 and turns it by c L / 3. Its clamp slips when the tip has come r = e / h L^2 / 4, where the outer fibre has the strain e
of the class of the material; h is half the width there. A section at u slips at r (1 - u)^-2 and moves the tip by 4 (1 - u)^3 du
of its way, so the share q of the way slips at r (1 - q)^(-1/2), and of the turn at 4 r / (3 L) (1 - q)^(-2/3). The three
operators are the middles of the thirds of q.

The strain is known no better than the class, and pulled robots bend otherwise: so r is fitted too (`StaticParameters.reach`), and
what is not known of it widens the interval of s. Without this friction, branches of creep that outlast a rest stand for what a
robot keeps of the poses before, and moduli for what they then lack.
"""

import numpy as np

from gravcomp.calibration.measured import Course
from gravcomp.description import Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.materials.material_classes import class_of

_THIRDS = np.array([1.0, 3.0, 5.0]) / 6.0  # their middles
_LENGTHS = np.column_stack([(1.0 - _THIRDS) ** (-1.0 / 2.0), 4.0 / 3.0 * (1.0 - _THIRDS) ** (-2.0 / 3.0)])
"""Of the operators (3, 2): for the way over r, and for the turn over r / L."""


def reach_of(robot: Robot, model: RobotModel) -> float:
    """Return r in m."""
    half = float(np.abs(model.mesh.nodes[model.mesh.clamped, :2]).max())
    return class_of(robot.materials[0].youngs_modulus).slip_strain / half * robot.length**2 / 4.0


def held_back(course: Course, reach: float, length: float) -> np.ndarray:
    """Return z (k, 6) of the tips, position in m and direction, in the k windows of a course.

    reach: r in m; length of the robot in m. At the beginning of a trial nothing holds the robot back.
    """
    parts = np.zeros((len(_LENGTHS), 2, 3))  # of the operators, position and direction
    most = (reach * _LENGTHS / [1.0, length])[:, :, None]
    moves = np.diff(course.tip, axis=0, prepend=course.tip[:1]).reshape(-1, 2, 3)
    found = np.zeros((len(moves), 6))
    for k, (move, begins) in enumerate(zip(moves, course.begins.tolist())):
        parts = np.zeros_like(parts) if begins else parts + move
        size = np.sqrt((parts * parts).sum(axis=2, keepdims=True))
        parts = parts * np.minimum(1.0, most / np.maximum(size, 1e-12))
        found[k] = parts.mean(axis=0).ravel()
    return course.window_means(found)
