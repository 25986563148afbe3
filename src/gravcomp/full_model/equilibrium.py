"""State of the full model in static equilibrium, or near it."""

import dataclasses

import numpy as np

from gravcomp.cables.tendons import TendonState
from gravcomp.full_model.touch import Touch


@dataclasses.dataclass
class Equilibrium:
    """A state of the robot and its last linearisation.

    u (n, 3): displacements in m; tension (m,) in N; compliance (m, m) in m/N; answer X (3 n_free, m): change of the unknowns
    per tension; tendons: the cables at this shape; residual: largest force out of balance in N; load_fraction: the fraction of
    the load that this state balances, less than 1 if no equilibrium was found for the whole load; touch: what touches, None
    where nothing has been sought.
    """

    u: np.ndarray
    tension: np.ndarray
    compliance: np.ndarray
    answer: np.ndarray
    tendons: TendonState
    residual: float = np.inf
    converged: bool = False
    iterations: int = 0
    load_fraction: float = 1.0
    touch: Touch | None = None
