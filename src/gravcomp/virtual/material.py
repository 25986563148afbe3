"""Material of the rod over time, compiled: a generalised Maxwell solid with damping and a frictional branch.

The law acts on the strains of rod.py, which are objective:

    sigma = K (epsilon - epsilon_0) + sum_j g_j K (epsilon - a_j) + eta K d epsilon/dt + slip,  d a_j/dt = (epsilon - a_j) / tau_j
    slip: a spring on the two curvatures, in series with a slider that yields at the moment m_y

The frictional branch makes the hysteresis that does not depend on the rate. Everything is integrated implicitly (backward Euler),
so that over one time step the law without the slider is linear in the strain at the end.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit


@dataclass(frozen=True)
class RodMaterial:
    """Parameters of the material beyond its long-term stiffness; n elements, k Maxwell branches."""

    branch_ratio: np.ndarray  # (n, k) stiffness of each branch over the long-term stiffness
    branch_time: np.ndarray  # (n, k) s
    damping_time: np.ndarray  # (n,) s, eta
    slip_stiffness: np.ndarray  # (n,) N m^2
    slip_moment: np.ndarray  # (n,) N m


@njit(cache=True, error_model="numpy")
def step_law(
    dt: float,
    stiffness: np.ndarray,
    rest_strain: np.ndarray,
    strain: np.ndarray,
    branch_strain: np.ndarray,
    branch_ratio: np.ndarray,
    branch_time: np.ndarray,
    damping_time: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return linear (n, 6, 6) and constant (n, 6) of the law sigma = linear (epsilon - epsilon_0) + constant over a step of dt s.

    epsilon is the strain at the end of the step; stiffness (n, 6, 6), rest_strain (n, 6), strain (n, 6) and branch_strain
    (k, n, 6) are those at the beginning of the step.
    """
    n, branches = stiffness.shape[0], branch_time.shape[1]
    linear, constant = np.empty((n, 6, 6)), np.zeros((n, 6))
    deviation = np.empty(6)
    for e in range(n):
        damping = damping_time[e] / dt
        total = 1.0 + damping
        for i in range(6):
            deviation[i] = damping * (rest_strain[e, i] - strain[e, i])
        for j in range(branches):
            part = branch_ratio[e, j] / (1.0 + dt / branch_time[e, j])
            total += part
            for i in range(6):
                deviation[i] += part * (rest_strain[e, i] - branch_strain[j, e, i])
        for i in range(6):
            for k in range(6):
                linear[e, i, k] = total * stiffness[e, i, k]
                constant[e, i] += stiffness[e, i, k] * deviation[k]
    return linear, constant


@njit(cache=True, error_model="numpy")
def update_history(
    dt: float,
    strain: np.ndarray,
    branch_strain: np.ndarray,
    slip_strain: np.ndarray,
    branch_time: np.ndarray,
    slip_stiffness: np.ndarray,
    slip_moment: np.ndarray,
) -> None:
    """Update branch_strain (k, n, 6) and slip_strain (n, 2) after a step of dt s that ended at strain (n, 6)."""
    for e in range(strain.shape[0]):
        for j in range(branch_time.shape[1]):
            r = dt / branch_time[e, j]
            for i in range(6):
                branch_strain[j, e, i] = (branch_strain[j, e, i] + r * strain[e, i]) / (1.0 + r)
        k0 = slip_stiffness[e] * (strain[e, 3] - slip_strain[e, 0])
        k1 = slip_stiffness[e] * (strain[e, 4] - slip_strain[e, 1])
        trial = math.sqrt(k0 * k0 + k1 * k1)
        if trial > slip_moment[e]:
            excess = (1.0 - slip_moment[e] / trial) / slip_stiffness[e]
            slip_strain[e, 0] += excess * k0
            slip_strain[e, 1] += excess * k1
