"""Internal forces, tangent stiffness and energy, summed over the quadrature points of all elements; compiled by Numba.

Arguments that all functions share: u (n, 3) displacements; connectivity (k, c) nodes of the elements; gradients (k, p, 3, c)
and weights (k, p) of `element_arrays`; law (k,) and constants (k, m) of `MaterialConstants`; moving: whether damping and creep
act, with factor (k,) and past (k, p, 6) of `ViscousStrain`.
"""

import numpy as np
from numba import njit

from gravcomp.materials import laws
from gravcomp.materials.linear import add_linear_tangent
from gravcomp.mechanics.kinematics import deformation_gradient, green_strain, strain_matrix, strain_rate
from gravcomp.mechanics.viscous_strain import add_viscous_stress
from gravcomp.rounding import REORDERED


@njit(cache=True, fastmath=REORDERED)
def add_internal_force(
    u: np.ndarray, moving: bool, factor: np.ndarray, past: np.ndarray, connectivity: np.ndarray, gradients: np.ndarray,
    weights: np.ndarray, law: np.ndarray, constants: np.ndarray, force: np.ndarray,
) -> None:  # fmt: skip
    """Add the internal forces f = sum w B^T S to force (n, 3)."""
    c = connectivity.shape[1]
    f = np.empty((3, 3))
    p1 = np.empty((3, 3))
    e = np.empty(6)
    s = np.empty(6)
    d = np.empty((6, 6))
    local = np.empty((3, c))
    for k in range(connectivity.shape[0]):
        local[:, :] = 0.0
        nodes = connectivity[k]
        for p in range(weights.shape[1]):
            gradient = gradients[k, p]
            _point(u, moving, factor[k], past[k, p], nodes, gradient, law[k], constants[k], f, e, s, d, False)
            w = weights[k, p]
            for i in range(3):  # first Piola-Kirchhoff stress F S
                p1[i, 0] = w * (f[i, 0] * s[0] + f[i, 1] * s[3] + f[i, 2] * s[5])
                p1[i, 1] = w * (f[i, 0] * s[3] + f[i, 1] * s[1] + f[i, 2] * s[4])
                p1[i, 2] = w * (f[i, 0] * s[5] + f[i, 1] * s[4] + f[i, 2] * s[2])
                for a in range(c):
                    local[i, a] += p1[i, 0] * gradient[0, a] + p1[i, 1] * gradient[1, a] + p1[i, 2] * gradient[2, a]
        for a in range(c):
            for i in range(3):
                force[nodes[a], i] += local[i, a]


@njit(cache=True, fastmath=REORDERED)
def add_force_and_stiffness(
    u: np.ndarray, moving: bool, factor: np.ndarray, past: np.ndarray, origin: np.ndarray, foreseen: bool,
    connectivity: np.ndarray, gradients: np.ndarray, weights: np.ndarray, law: np.ndarray, constants: np.ndarray,
    force: np.ndarray, position: np.ndarray, values: np.ndarray,
) -> None:  # fmt: skip
    """Add internal forces to force (n, 3) and the tangent stiffness to `values` at `position` (of `scatter_positions`).

    If `foreseen`, the geometric stiffness uses the stress that the last Newton step from `origin` (n, 3) predicted: see
    `SolidElements.assemble`.
    """
    c = connectivity.shape[1]
    n = 3 * c
    f = np.empty((3, 3))
    e = np.empty(6)
    s = np.empty(6)
    d = np.zeros((6, 6))
    b = np.empty((6, n))
    db = np.empty((6, n))
    sg = np.empty((3, c))
    local_f = np.empty(n)
    local_k = np.empty((n, n))
    geometric = np.empty((c, c))
    for k in range(connectivity.shape[0]):
        local_f[:] = 0.0
        local_k[:, :] = 0.0
        geometric[:, :] = 0.0
        nodes = connectivity[k]
        for p in range(weights.shape[1]):
            gradient = gradients[k, p]
            w = weights[k, p]
            _point(u, moving, factor[k], past[k, p], nodes, gradient, law[k], constants[k], f, e, s, d, True)
            if moving:
                add_linear_tangent(constants[k, 0], constants[k, 1], factor[k], d)
            strain_matrix(f, gradient, b)
            for m in range(6):
                ws = w * s[m]
                d0, d1, d2 = w * d[m, 0], w * d[m, 1], w * d[m, 2]
                d3, d4, d5 = w * d[m, 3], w * d[m, 4], w * d[m, 5]
                for r in range(n):
                    local_f[r] += b[m, r] * ws
                    db[m, r] = d0 * b[0, r] + d1 * b[1, r] + d2 * b[2, r] + d3 * b[3, r] + d4 * b[4, r] + d5 * b[5, r]
            for r in range(n):
                b0, b1, b2, b3, b4, b5 = b[0, r], b[1, r], b[2, r], b[3, r], b[4, r], b[5, r]
                for q in range(r + 1):
                    local_k[r, q] += b0 * db[0, q] + b1 * db[1, q] + b2 * db[2, q] + b3 * db[3, q] + b4 * db[4, q] + b5 * db[5, q]
            if foreseen:
                _foreseen_stress(origin, nodes, gradient, law[k], constants[k], f, e, s, d)
            for a in range(c):
                g0, g1, g2 = w * gradient[0, a], w * gradient[1, a], w * gradient[2, a]
                sg[0, a] = s[0] * g0 + s[3] * g1 + s[5] * g2
                sg[1, a] = s[3] * g0 + s[1] * g1 + s[4] * g2
                sg[2, a] = s[5] * g0 + s[4] * g1 + s[2] * g2
            for a in range(c):
                g0, g1, g2 = gradient[0, a], gradient[1, a], gradient[2, a]
                for q in range(a + 1):
                    geometric[a, q] += g0 * sg[0, q] + g1 * sg[1, q] + g2 * sg[2, q]
        entry = 0
        for i in range(3):
            for a in range(c):
                row = i * c + a
                force[nodes[a], i] += local_f[row]
                for q in range(a + 1):
                    local_k[row, i * c + q] += geometric[a, q]
                for q in range(row + 1):
                    target = position[k, entry]
                    entry += 1
                    if target >= 0:
                        values[target] += local_k[row, q]


@njit(cache=True, fastmath=REORDERED)
def total_energy(
    u: np.ndarray, connectivity: np.ndarray, gradients: np.ndarray, weights: np.ndarray, law: np.ndarray, constants: np.ndarray
) -> float:
    """Return the elastic energy in J."""
    total = 0.0
    f = np.empty((3, 3))
    e = np.empty(6)
    for k in range(connectivity.shape[0]):
        for p in range(weights.shape[1]):
            deformation_gradient(u, connectivity[k], gradients[k, p], f)
            green_strain(f, e)
            total += weights[k, p] * laws.energy(law[k], constants[k], e)
    return total


@njit(cache=True)
def add_between_nodes(local: np.ndarray, position: np.ndarray, values: np.ndarray) -> None:
    """Add matrices (k, c, c) between the nodes of the elements, equal in x, y and z, to `values` at `position`."""
    c = local.shape[1]
    for k in range(local.shape[0]):
        for i in range(3):
            for a in range(c):
                row = i * c + a
                for q in range(a + 1):
                    target = position[k, row * (row + 1) // 2 + i * c + q]
                    if target >= 0:
                        values[target] += local[k, a, q]


@njit(cache=True, fastmath=REORDERED)
def _point(
    u: np.ndarray, moving: bool, factor: float, past: np.ndarray, nodes: np.ndarray, gradient: np.ndarray, law: int,
    constants: np.ndarray, f: np.ndarray, e: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool,
) -> None:  # fmt: skip
    """Write f, e and s (with damping) at one point, and the elastic dS/dE into d if `tangent`."""
    deformation_gradient(u, nodes, gradient, f)
    green_strain(f, e)
    laws.stress(law, constants, e, s, d, tangent)
    if moving:
        add_viscous_stress(factor, past, constants, e, s)


@njit(cache=True, fastmath=REORDERED)
def _foreseen_stress(
    origin: np.ndarray, nodes: np.ndarray, gradient: np.ndarray, law: int, constants: np.ndarray, f: np.ndarray, e: np.ndarray,
    s: np.ndarray, d: np.ndarray,
) -> None:  # fmt: skip
    """Write the stress s (6) that is linear in the step from `origin` to the present f (3, 3): S + dS/dE : B du, both at `origin`.

    The law itself at the strain that is linear in the step would answer a rotation, whose linear strain is a shear that changes
    the volume, with a pressure.
    """
    start = np.empty((3, 3))
    step = np.empty((3, 3))
    deformation_gradient(origin, nodes, gradient, start)
    for i in range(3):
        for j in range(3):
            step[i, j] = f[i, j] - start[i, j]
    rate = np.empty(6)
    green_strain(start, e)
    strain_rate(start, step, rate)
    laws.stress(law, constants, e, s, d, True)
    for m in range(6):
        for n in range(6):
            s[m] += d[m, n] * rate[n]
