"""A geometrically exact rod with tendons: strains, forces and tangent, compiled.

The rod is a chain of rigid cross-sections H_k = (R_k, p_k), the body axis being z. Between two of them the strain is constant
(helicoidal interpolation on SE(3); Sonneville, Cardona, Bruls 2014), so no integration and no locking:

    theta = log(H_A^-1 H_B),  epsilon = theta / L = (v, w),  v = (shear, shear, stretch), w = (curvature, curvature, twist)
    sigma = K (epsilon - e_z) + ...                                  Cosserat law; the material's history enters as A, b below
    delta theta = J_r^-1(theta) eta_B - J_l^-1(theta) eta_A          eta: body-frame variations of the two cross-sections

A tendon at the offset d in the cross-section has in such an element the length l = L |v + w x d|, exactly, and the tension T
that arrives there pulls with T (t, d x t), t the unit vector along v + w x d (D. C. Rucker, R. J. Webster, "Statics and
dynamics of continuum robots with general tendon routing and external loading", IEEE T-RO 27, 2011).

A tendon is a spring that only pulls: T_0 = k max(0, u + l - l_0) + preload, u the displacement pulled in at the base, and
friction lets the share s_e T_0 arrive in element e. It couples all elements it passes, which the solver takes as an update of
rank one each.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.virtual.se3 import inverse_jacobians, motion_log


@dataclass(frozen=True)
class RodModel:
    """The rod as the kernels need it; n elements, m tendons. SI units."""

    length: np.ndarray  # (n,) m, at rest
    stiffness: np.ndarray  # (n, 6) shear, shear, stretch (N); bending, bending, torsion (N m^2)
    mass: np.ndarray  # (n + 1,) kg, lumped in the cross-sections
    inertia: np.ndarray  # (n + 1, 3) kg m^2, about the body axes
    tendon_offset: np.ndarray  # (m, 3) m, where the tendons pass through the cross-section
    tendon_start: np.ndarray  # (m,) int, first element that each tendon passes
    tendon_end: np.ndarray  # (m,) int, the element after the last one
    tendon_stiffness: np.ndarray  # (m,) N/m, from the capstan to the anchor

    @property
    def elements(self) -> int:
        return len(self.length)

    @property
    def tendons(self) -> int:
        return len(self.tendon_end)

    @functools.cached_property
    def station(self) -> np.ndarray:
        """(n + 1,) of the cross-sections: 0 at the base to 1 at the tip."""
        along = np.concatenate([[0.0], np.cumsum(self.length)])
        return along / along[-1]

    @functools.cached_property
    def tendon_length(self) -> np.ndarray:
        """(m,) m, inside the straight rod."""
        return np.array([self.length[a:b].sum() for a, b in zip(self.tendon_start, self.tendon_end)])

    def straight(self) -> tuple[np.ndarray, np.ndarray]:
        """Orientations (n + 1, 3, 3) and positions (n + 1, 3) of the unloaded rod along z."""
        position = np.zeros((self.elements + 1, 3))
        position[1:, 2] = np.cumsum(self.length)
        return np.tile(np.eye(3), (self.elements + 1, 1, 1)), position


@njit(cache=True, error_model="numpy")
def strains(orientation, position, length, out):
    """out (n, 6): strain of each element."""
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
def tendon_lengths(strain, length, tendon_offset, tendon_start, tendon_end, direction, out):
    """out (m, n): length of each tendon in each element (0 where it does not pass); direction (m, n, 3): its unit vectors
    there.
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


@njit(cache=True, error_model="numpy")
def assemble(
    orientation,
    length,
    strain,
    linear,
    constant,
    slip_stiffness,
    slip_moment,
    slip_strain,
    tendon_offset,
    tendon_start,
    tendon_end,
    direction,
    path,
    tension,
    share,
    force,
    gradient,
    pull,
    band,
):
    """Forces and tangent of rod and tendons in body-frame variations of the cross-sections.

    sigma = linear (n, 6) * (epsilon - e_z) + constant (n, 6) + friction of the material (slip_*: see material.py) + tendons.
    tension (m,) at the base, share (m, n) of it that arrives in each element, force (n + 1, 3) on the cross-sections in the
    fixed frame. Returns the residual (n + 1, 6), internal minus external; fills gradient (6 n, m) = d path / d eta, pull (6 n,
    m) = d residual / d tension and band (6 n, 23), the tangent without the tendons' springs; the first cross-section is
    clamped and has no rows.
    """
    n, m = length.shape[0], tendon_end.shape[0]
    residual = np.zeros((n + 1, 6))
    gradient[:] = 0.0
    pull[:] = 0.0
    band[:] = 0.0
    left, right = np.empty((6, 6)), np.empty((6, 6))
    tangent, product = np.empty((6, 6)), np.empty((6, 6))
    theta, sigma, unit = np.empty(6), np.empty(6), np.empty(6)
    second = np.empty((3, 6))
    for e in range(n):
        for i in range(6):
            theta[i] = strain[e, i] * length[e]
            sigma[i] = linear[e, i] * (strain[e, i] - (1.0 if i == 2 else 0.0)) + constant[e, i]
            for j in range(6):
                tangent[i, j] = 0.0
            tangent[i, i] = linear[e, i]
        inverse_jacobians(theta, left, right)

        k0 = slip_stiffness[e] * (strain[e, 3] - slip_strain[e, 0])
        k1 = slip_stiffness[e] * (strain[e, 4] - slip_strain[e, 1])
        trial = math.sqrt(k0 * k0 + k1 * k1)
        factor = 1.0 if trial <= slip_moment[e] else slip_moment[e] / trial
        sigma[3] += factor * k0
        sigma[4] += factor * k1
        tangent[3, 3] += factor * slip_stiffness[e]
        tangent[4, 4] += factor * slip_stiffness[e]

        for c in range(m):
            if e < tendon_start[c] or e >= tendon_end[c]:
                continue
            here = tension[c] * share[c, e]
            d0, d1 = tendon_offset[c, 0], tendon_offset[c, 1]
            t0, t1, t2 = direction[c, e, 0], direction[c, e, 1], direction[c, e, 2]
            unit[0], unit[1], unit[2] = t0, t1, t2
            unit[3], unit[4], unit[5] = d1 * t2, -d0 * t2, d0 * t1 - d1 * t0
            for i in range(6):
                sigma[i] += here * unit[i]
            # d(t)/d(epsilon) = (1 - t t^T) [1, -d^] / |v + w x d|
            scale = here * length[e] / path[c, e]
            for i in range(3):
                ti = unit[i]
                for j in range(6):
                    second[i, j] = -ti * unit[j]
            for i in range(3):
                second[i, i] += 1.0
            second[0, 5] -= d1
            second[1, 5] += d0
            second[2, 3] += d1
            second[2, 4] -= d0
            for j in range(6):
                a0, a1, a2 = scale * second[0, j], scale * second[1, j], scale * second[2, j]
                tangent[0, j] += a0
                tangent[1, j] += a1
                tangent[2, j] += a2
                tangent[3, j] += d1 * a2
                tangent[4, j] -= d0 * a2
                tangent[5, j] += d0 * a1 - d1 * a0
            for i in range(6):
                to_a, to_b = 0.0, 0.0
                for j in range(6):
                    to_a -= left[j, i] * unit[j]
                    to_b += right[j, i] * unit[j]
                if e > 0:
                    gradient[6 * (e - 1) + i, c] += to_a
                    pull[6 * (e - 1) + i, c] += share[c, e] * to_a
                gradient[6 * e + i, c] += to_b
                pull[6 * e + i, c] += share[c, e] * to_b

        for i in range(6):
            to_a, to_b = 0.0, 0.0
            for j in range(6):
                to_a -= left[j, i] * sigma[j]
                to_b += right[j, i] * sigma[j]
            residual[e, i] += to_a
            residual[e + 1, i] += to_b
        for i in range(6):
            for j in range(6):
                tangent[i, j] /= length[e]
        for side in range(2):  # column: variation of A, then of B
            jacobian = left if side == 0 else right
            sign = -1.0 if side == 0 else 1.0
            column = 6 * (e - 1 + side)
            if column < 0:
                continue
            for i in range(6):
                for j in range(6):
                    value = 0.0
                    for k in range(6):
                        value += tangent[i, k] * jacobian[k, j]
                    product[i, j] = sign * value
            for i in range(6):
                for j in range(6):
                    # The stress turns with the strain: half of ad(d theta)^T sigma on either side.
                    if i < 3:
                        p, q = (i + 1) % 3, (i + 2) % 3
                        turning = sign * (sigma[p] * jacobian[3 + q, j] - sigma[q] * jacobian[3 + p, j])
                    else:
                        p, q = (i - 2) % 3, (i - 1) % 3
                        turning = sign * (sigma[p] * jacobian[q, j] - sigma[q] * jacobian[p, j])
                        turning += sign * (sigma[3 + p] * jacobian[3 + q, j] - sigma[3 + q] * jacobian[3 + p, j])
                    to_a, to_b = 0.5 * turning, 0.5 * turning
                    for k in range(6):
                        to_a -= left[k, i] * product[k, j]
                        to_b += right[k, i] * product[k, j]
                    if e > 0:
                        row = 6 * (e - 1) + i
                        band[row, column + j - row + 11] += to_a
                    row = 6 * e + i
                    band[row, column + j - row + 11] += to_b

    for k in range(n + 1):
        r = orientation[k]
        f0 = r[0, 0] * force[k, 0] + r[1, 0] * force[k, 1] + r[2, 0] * force[k, 2]
        f1 = r[0, 1] * force[k, 0] + r[1, 1] * force[k, 1] + r[2, 1] * force[k, 2]
        f2 = r[0, 2] * force[k, 0] + r[1, 2] * force[k, 1] + r[2, 2] * force[k, 2]
        residual[k, 0] -= f0
        residual[k, 1] -= f1
        residual[k, 2] -= f2
        if k > 0:
            row = 6 * (k - 1)
            band[row, 15] += f2
            band[row, 16] -= f1
            band[row + 1, 13] -= f2
            band[row + 1, 15] += f0
            band[row + 2, 12] += f1
            band[row + 2, 13] -= f0
    return residual


@njit(cache=True, error_model="numpy")
def solve(band, right_sides):
    """Solve in place: band (N, 23) holds a matrix with 11 diagonals on either side, right_sides (N, r).

    No pivoting: the tangent at a stable equilibrium is positive definite, and inertia adds to that.
    """
    size, width, columns = band.shape[0], 11, right_sides.shape[1]
    for k in range(size):
        pivot = 1.0 / band[k, width]
        last = min(size, k + width + 1)
        for i in range(k + 1, last):
            shift = k - i + width
            factor = band[i, shift] * pivot
            if factor == 0.0:
                continue
            for j in range(1, last - k):
                band[i, shift + j] -= factor * band[k, width + j]
            for c in range(columns):
                right_sides[i, c] -= factor * right_sides[k, c]
    for k in range(size - 1, -1, -1):
        last = min(size, k + width + 1)
        for j in range(k + 1, last):
            value = band[k, j - k + width]
            for c in range(columns):
                right_sides[k, c] -= value * right_sides[j, c]
        pivot = 1.0 / band[k, width]
        for c in range(columns):
            right_sides[k, c] *= pivot


@njit(cache=True, error_model="numpy")
def newton_step(band, residual, gradient, pull, spring):
    """The increment (6 n,) of the free cross-sections: (band + pull diag(spring) gradient^T) increment = -residual.

    spring (m,) is dT_0/d path, 0 for a slack tendon. The tendons enter by the Sherman-Morrison-Woodbury formula.
    """
    size, m = gradient.shape
    sides = np.empty((size, m + 1))
    for k in range(size):
        sides[k, 0] = -residual[1 + k // 6, k % 6]
        for c in range(m):
            sides[k, 1 + c] = pull[k, c]
    solve(band, sides)
    small, known = np.zeros((m, m)), np.zeros(m)
    for a in range(m):
        small[a, a] = 1.0
        if spring[a] == 0.0:
            continue
        for k in range(size):
            g = spring[a] * gradient[k, a]
            known[a] += g * sides[k, 0]
            for b in range(m):
                small[a, b] += g * sides[k, 1 + b]
    correction = _solve_small(small, known)
    increment = np.empty(size)
    for k in range(size):
        increment[k] = sides[k, 0]
        for c in range(m):
            increment[k] -= sides[k, 1 + c] * correction[c]
    return increment


@njit(cache=True, error_model="numpy")
def _solve_small(matrix, right_side):
    n = matrix.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right_side[k], right_side[best] = right_side[best], right_side[k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= factor * matrix[k, j]
            right_side[i] -= factor * right_side[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right_side[k] -= matrix[k, j] * right_side[j]
        right_side[k] /= matrix[k, k]
    return right_side
