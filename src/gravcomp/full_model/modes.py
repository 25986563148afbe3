"""Vibration modes of the straight robot, K phi = omega^2 M phi, by shift-invert Lanczos iteration (SciPy's `eigsh`)."""

import functools

import numpy as np

from gravcomp.description import Robot
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh.coarse import with_coarse_elements


def natural_frequencies(model: RobotModel, count: int = 6) -> np.ndarray:
    """Return the `count` lowest natural frequencies in Hz, without damping, cables and gravity."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    n = model.pattern.n
    stiffness = model.new_matrix()
    model.elements.assemble(np.zeros_like(model.mesh.nodes), stiffness)
    mass = model.mass_matrix()
    factor = stiffness.factor()
    start = model.weight(np.array([1.0, 1.0, 1.0]))  # contains every mode; fixed, so that results repeat
    values = eigsh(
        LinearOperator((n, n), matvec=lambda x: x, dtype=float),  # not used: `OPinv` replaces it
        k=count,
        M=LinearOperator((n, n), matvec=mass.multiply, dtype=float),
        sigma=0.0,
        OPinv=LinearOperator((n, n), matvec=factor.solve, dtype=float),
        v0=start,
        return_eigenvectors=False,
    )
    return np.sort(np.sqrt(np.maximum(values, 0.0))) / (2.0 * np.pi)


def first_period(robot: Robot) -> float:
    """Return the period in s of the slowest motion of the straight robot, from a coarse mesh: right within a few per cent.

    Raises MeshError for a body that cannot be meshed.
    """
    # The file of a body may change.
    return _known_period(robot) if robot.body is None else _period(robot)


def _period(robot: Robot) -> float:
    return float(1.0 / natural_frequencies(RobotModel(with_coarse_elements(robot)), 1)[0])


_known_period = functools.lru_cache(maxsize=16)(_period)
