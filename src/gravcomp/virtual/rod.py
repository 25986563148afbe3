"""A geometrically exact rod with tendons: its data and its strains, compiled.

The rod is a chain of rigid cross-sections H_k = (R_k, p_k); the body axis is z. Between two of them the strain is constant
(helicoidal interpolation on SE(3); Sonneville, Cardona, Bruls 2014), so there is no integration and no locking:

    theta = log(H_A^-1 H_B),  epsilon = theta / L = (v, w),  v = (shear, shear, stretch), w = (curvature, curvature, twist)
"""

import functools
from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.virtual.routing import Routing, tendon_lengths
from gravcomp.virtual.se3 import advance, copy_pose, motion_exp, motion_log


@dataclass(frozen=True)
class RodModel:
    """Constant data of the rod; n elements, m tendons. SI units."""

    length: np.ndarray  # (n,) m, at rest
    stiffness: np.ndarray  # (n, 6, 6) symmetric; shear, shear, stretch (N); bending, bending, torsion (N m^2); couplings (N m)
    filament: np.ndarray  # (n, 9, 3) y and -x (m), E times area (N): see law_curve.py
    curve: np.ndarray  # (n, 3) c and d of the law in them, and the strain from which on the slope stays
    rest_strain: np.ndarray  # (n, 6) of the unloaded rod: (0, 0, 1, curvature, curvature, 0)
    mass: np.ndarray  # (n + 1,) kg, lumped in the cross-sections
    centre: np.ndarray  # (n + 1, 3) m, centre of that mass, along the axes of the cross-section
    inertia: np.ndarray  # (n + 1, 3, 3) kg m^2, about the axis, along the body axes
    routing: Routing  # of the tendons
    tendon_stiffness: np.ndarray  # (m,) N/m, from the capstan to the anchor

    @property
    def elements(self) -> int:
        """Number of elements, n."""
        return len(self.length)

    @property
    def tendons(self) -> int:
        """Number of tendons, m."""
        return len(self.tendon_stiffness)

    @functools.cached_property
    def station(self) -> np.ndarray:
        """Stations (n + 1,) of the cross-sections: 0 at the base, 1 at the tip."""
        along = np.concatenate([[0.0], np.cumsum(self.length)])
        return along / along[-1]

    @functools.cached_property
    def tendon_length(self) -> np.ndarray:
        """Lengths (m,) of the tendons inside the unloaded rod, m."""
        path = np.empty((self.tendons, self.elements))
        direction, chord = self.scratch()
        tendon_lengths(*self.unloaded(), self.rest_strain, self.length, self.routing, direction, chord, path)
        return path.sum(axis=1)

    @functools.cached_property
    def tolerances(self) -> np.ndarray:
        """Force (N) and moment (N m) that stand for zero in a residual.

        Small against the weight, or against a load that bends the rod by a thousandth of its length where it weighs next to
        nothing, and above the rounding of its stiffest direction.
        """
        total = float(self.length.sum())
        bending = float(self.stiffness[:, 3, 3].min())
        load = max(9.81 * float(self.mass.sum()), 1e-3 * bending / total**2)
        force = max(2e-7 * load, 1e-14 * float(self.stiffness[:, 2, 2].max()))
        return np.array([force, 10.0 * force * total])

    def unloaded(self) -> tuple[np.ndarray, np.ndarray]:
        """Return orientations (n + 1, 3, 3) and positions (n + 1, 3) of the unloaded rod, which leaves the base along z."""
        orientation, position = np.tile(np.eye(3), (self.elements + 1, 1, 1)), np.zeros((self.elements + 1, 3))
        turn, shift, work = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
        for e in range(self.elements):
            motion_exp(self.length[e] * self.rest_strain[e], turn, shift)
            copy_pose(orientation[e], position[e], orientation[e + 1], position[e + 1])
            advance(orientation[e + 1], position[e + 1], turn, shift, work)
        return orientation, position

    def scratch(self) -> tuple[np.ndarray, np.ndarray]:
        """Return arrays for the directions of `tendon_lengths`: (m, n, 3) in channels, (q, 4) of the chords."""
        return np.zeros((self.tendons, self.elements, 3)), np.empty((len(self.routing.chord_tendon), 4))


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
