"""How samples answer to forces on the modes: the inverse of the full model's stiffness at each of them."""

import numpy as np

from gravcomp.full_model.robot_model import RobotModel
from gravcomp.training.samples import Sample


def compliances(model: RobotModel, basis: np.ndarray, samples: list[Sample]) -> np.ndarray:
    """Return the compliance (s, r, r) of the body at given tensions on a basis (3 n_free, r), at each sample.

    It is that of the straight robot where a sample is not stable at given tensions.
    """
    matrix, u = model.new_matrix(), np.zeros_like(model.mesh.nodes)
    model.elements.assemble(u, matrix)
    at_rest = np.linalg.inv(basis.T @ matrix.multiply(basis))
    found = np.empty((len(samples), *at_rest.shape))
    for compliance, sample in zip(found, samples):
        model.free(u)[:] = sample.unknowns
        matrix.values[:] = 0.0
        model.elements.assemble(u, matrix)
        if sample.tension.any():
            tendons = model.tendons.state(model.mesh.nodes + u, sample.pulling)
            model.tendons.add_stiffness(tendons, sample.tension, matrix)
        stiffness = basis.T @ matrix.multiply(basis)
        stable = np.linalg.eigvalsh(stiffness)[0] > 0.0
        compliance[:] = np.linalg.inv(stiffness) if stable else at_rest
    return found
