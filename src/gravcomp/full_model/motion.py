"""State of the full model in motion."""

import dataclasses
from collections.abc import Callable

import numpy as np

from gravcomp.cables.tendons import TendonState

ExternalForce = Callable[[np.ndarray], np.ndarray]
"""Force on the unknowns, of the displacements in which they are given."""


@dataclasses.dataclass
class Motion:
    """A state of motion at the end of a step.

    u, velocity and acceleration (n, 3) in SI; tension (m,) in N; tendons: the cables at u; force (3 n_free,): g of
    `generalized_alpha` in N; strain and strain_before (k, p, 6): Green's strain now and one step before; held (b, k, p, 6): that
    of the branches of `viscosity`; step: length of the last step in s; residual: largest force out of balance in N.
    """

    u: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    tension: np.ndarray
    tendons: TendonState
    force: np.ndarray
    strain: np.ndarray
    strain_before: np.ndarray
    held: np.ndarray
    step: float = 0.0
    residual: float = 0.0
    converged: bool = True
