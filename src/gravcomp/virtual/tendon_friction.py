"""Friction of the tendons: the capstan equation with a sliding state, compiled.

Of the tension at the capstan the share

    share_e = exp(-mu (z_0 Theta_guide + sum_{j <= e} z_j Theta_j))

arrives in element e, Theta_j the angle by which element j is bent. The sliding state z in [-1, 1] follows P. R. Dahl's presliding
over the distance delta:

    dz/ds = (1 - z sign(ds)) / delta,    s: sliding toward the base
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit


@dataclass(frozen=True)
class TendonFriction:
    """Friction of m tendons."""

    coefficient: np.ndarray  # (m,) mu
    guide_angle: np.ndarray  # (m,) rad, Theta_guide: angle that the cable turns through between capstan and robot
    presliding: float  # m, delta


@njit(cache=True, error_model="numpy")
def tension_shares(
    strain: np.ndarray,
    length: np.ndarray,
    sliding: np.ndarray,
    tendon_start: np.ndarray,
    tendon_end: np.ndarray,
    mu: np.ndarray,
    guide_angle: np.ndarray,
) -> np.ndarray:
    """Return the share (m, n) of the tension at the capstan that arrives in each element.

    strain (n, 6), length (n,); sliding (m, n + 1) holds z of the guide, then of the elements; mu and guide_angle (m,).
    """
    n, m = length.shape[0], tendon_end.shape[0]
    share = np.ones((m, n))
    for c in range(m):
        exponent = sliding[c, 0] * guide_angle[c]
        for e in range(tendon_start[c], tendon_end[c]):
            half = 0.5 * length[e] * math.sqrt(strain[e, 3] ** 2 + strain[e, 4] ** 2) * sliding[c, e + 1]
            exponent += half
            share[c, e] = math.exp(-mu[c] * exponent)
            exponent += half
    return share


@njit(cache=True, error_model="numpy")
def update_sliding(
    sliding: np.ndarray,
    path_before: np.ndarray,
    path: np.ndarray,
    wound_before: np.ndarray,
    wound: np.ndarray,
    presliding: float,
) -> None:
    """Update sliding (m, n + 1) after a step from path_before to path (m, n) m and from wound_before to wound (m,) m."""
    m, n = path.shape
    for c in range(m):
        beyond = 0.0
        for e in range(n - 1, -1, -1):
            beyond += path_before[c, e] - path[c, e]
            sliding[c, e + 1] = _slide(sliding[c, e + 1], beyond, presliding)
        sliding[c, 0] = _slide(sliding[c, 0], wound[c] - wound_before[c], presliding)


@njit(cache=True, error_model="numpy")
def _slide(z: float, distance: float, presliding: float) -> float:
    """Return the sliding state after sliding by `distance` m toward the base: Dahl's equation, integrated exactly."""
    if distance >= 0.0:
        return 1.0 - (1.0 - z) * math.exp(-distance / presliding)
    return -1.0 + (1.0 + z) * math.exp(distance / presliding)
