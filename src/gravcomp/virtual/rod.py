"""A geometrically exact rod with tendons: its data, its strains and the lengths of its tendons, compiled.

The rod is a chain of rigid cross-sections H_k = (R_k, p_k); the body axis is z. Between two of them the strain is constant
(helicoidal interpolation on SE(3); Sonneville, Cardona, Bruls 2014), so there is no integration and no locking:

    theta = log(H_A^-1 H_B),  epsilon = theta / L = (v, w),  v = (shear, shear, stretch), w = (curvature, curvature, twist)

A tendon at the offset d in the cross-section has the length l = L |v + w x d| in an element, exactly.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.virtual.se3 import motion_log


@dataclass(frozen=True)
class RodModel:
    """Constant data of the rod; n elements, m tendons. SI units."""

    length: np.ndarray  # (n,) m, at rest
    stiffness: np.ndarray  # (n, 6) shear, shear, stretch (N); bending, bending, torsion (N m^2)
    mass: np.ndarray  # (n + 1,) kg, lumped in the cross-sections
    inertia: np.ndarray  # (n + 1, 3) kg m^2, about the body axes
    tendon_offset: np.ndarray  # (m, 3) m, position of each tendon in the cross-section
    tendon_start: np.ndarray  # (m,) int, first element of each tendon
    tendon_end: np.ndarray  # (m,) int, the element after the last one of each tendon
    tendon_stiffness: np.ndarray  # (m,) N/m, from the capstan to the anchor

    @property
    def elements(self) -> int:
        """Number of elements, n."""
        return len(self.length)

    @property
    def tendons(self) -> int:
        """Number of tendons, m."""
        return len(self.tendon_end)

    @functools.cached_property
    def station(self) -> np.ndarray:
        """Stations (n + 1,) of the cross-sections: 0 at the base, 1 at the tip."""
        along = np.concatenate([[0.0], np.cumsum(self.length)])
        return along / along[-1]

    @functools.cached_property
    def tendon_length(self) -> np.ndarray:
        """Lengths (m,) of the tendons inside the straight rod, m."""
        return np.array([self.length[a:b].sum() for a, b in zip(self.tendon_start, self.tendon_end)])

    def straight(self) -> tuple[np.ndarray, np.ndarray]:
        """Return orientations (n + 1, 3, 3) and positions (n + 1, 3) of the unloaded rod along z."""
        position = np.zeros((self.elements + 1, 3))
        position[1:, 2] = np.cumsum(self.length)
        return np.tile(np.eye(3), (self.elements + 1, 1, 1)), position


@njit(cache=True, error_model="numpy")
def strains(orientation: np.ndarray, position: np.ndarray, length: np.ndarray, out: np.ndarray) -> None:
    """Write the strain of each element to out (n, 6), from orientation (n + 1, 3, 3), position (n + 1, 3), length (n,)."""
    relative, translation, difference = np.empty((3, 3)), np.empty(3), np.empty(3)
    for e in range(length.shape[0]):
        a, b = orientation[e], orientation[e + 1]
        for i in range(3):
            difference[i] = position[e + 1, i] - position[e, i]
        for i in range(3):
            translation[i] = a[0, i] * difference[0] + a[1, i] * difference[1] + a[2, i] * difference[2]
            for j in range(3):
                relative[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]
        motion_log(relative, translation, out[e])
        for i in range(6):
            out[e, i] /= length[e]


@njit(cache=True, error_model="numpy")
def tendon_lengths(
    strain: np.ndarray,
    length: np.ndarray,
    tendon_offset: np.ndarray,
    tendon_start: np.ndarray,
    tendon_end: np.ndarray,
    direction: np.ndarray,
    out: np.ndarray,
) -> None:
    """Write the length of each tendon in each element to out (m, n), 0 where a tendon does not pass.

    direction (m, n, 3) receives the unit vectors along the tendons there.
    """
    for c in range(tendon_end.shape[0]):
        d0, d1 = tendon_offset[c, 0], tendon_offset[c, 1]
        for e in range(length.shape[0]):
            if e < tendon_start[c] or e >= tendon_end[c]:
                out[c, e] = 0.0
                continue
            x = strain[e, 0] - strain[e, 5] * d1
            y = strain[e, 1] + strain[e, 5] * d0
            z = strain[e, 2] + strain[e, 3] * d1 - strain[e, 4] * d0
            norm = math.sqrt(x * x + y * y + z * z)
            direction[c, e, 0], direction[c, e, 1], direction[c, e, 2] = x / norm, y / norm, z / norm
            out[c, e] = length[e] * norm
