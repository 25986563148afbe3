"""Internal forces, tangent stiffness and energy, summed over the quadrature points of all elements; compiled by Numba.

Arguments that all functions share: u (n, 3) displacements; solid; moving: whether damping and creep act, with factor (k,),
past (k, p, 6) and damped (k,) of `ViscousStrain`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.materials import laws
from gravcomp.materials.fibres import add_fibre_stress, fibre_energy
from gravcomp.materials.invariants import bulk_modulus
from gravcomp.materials.linear import add_linear_tangent
from gravcomp.materials.volume import add_mean_volume, mean_volume_energy, volume_measure
from gravcomp.mechanics.kinematics import deformation_gradient, green_strain, strain_matrix, strain_rate
from gravcomp.mechanics.viscous_strain import add_viscous_stress
from gravcomp.rounding import REORDERED

_LARGEST_FIRST = 9.0  # lambda / mu of damping and creep: that of Poisson's ratio 0.45


class Solid(NamedTuple):
    """Constant arrays of k elements with p quadrature points.

    connectivity (k, c) nodes of the elements; gradients (k, p, 3, c) and weights (k, p) of `element_arrays`; law (k,) and
    constants (k, m) of `MaterialConstants`; fibres (k, p, f, 6) of `fibre_directions`; averaged (k,): whether the element's
    pressure follows from its mean volume, see `materials.volume`.
    """

    connectivity: np.ndarray
    gradients: np.ndarray
    weights: np.ndarray
    law: np.ndarray
    constants: np.ndarray
    fibres: np.ndarray
    averaged: np.ndarray


@njit(cache=True, fastmath=REORDERED)
def add_internal_force(
    u: np.ndarray, moving: bool, factor: np.ndarray, past: np.ndarray, solid: Solid, force: np.ndarray
) -> None:
    """Add the internal forces f = sum w B^T S to force (n, 3)."""
    c = solid.connectivity.shape[1]
    f = np.empty((3, 3))
    p1 = np.empty((3, 3))
    e = np.empty(6)
    s = np.empty(6)
    d = np.empty((6, 6))
    slope = np.empty(6)
    local = np.empty((3, c))
    for k in range(solid.connectivity.shape[0]):
        local[:, :] = 0.0
        nodes = solid.connectivity[k]
        first, shear = _viscous_constants(solid, k)
        mean = _mean_volume(u, solid, k) if solid.averaged[k] else 0.0
        for p in range(solid.weights.shape[1]):
            gradient = solid.gradients[k, p]
            deformation_gradient(u, nodes, gradient, f)
            green_strain(f, e)
            _stress(solid, k, p, mean, e, slope, s, d, False)
            if moving:
                add_viscous_stress(factor[k], past[k, p], first, shear, e, s)
            w = solid.weights[k, p]
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
    u: np.ndarray, moving: bool, factor: np.ndarray, past: np.ndarray, damped: np.ndarray, origin: np.ndarray, foreseen: bool,
    solid: Solid, force: np.ndarray, position: np.ndarray, values: np.ndarray,
) -> None:  # fmt: skip
    """Add internal forces to force (n, 3) and the tangent stiffness to `values` at `position` (of `scatter_positions`).

    If `foreseen`, the geometric stiffness uses the stress that the last Newton step from `origin` (n, 3) predicted: see
    `SolidElements.assemble`.
    """
    c = solid.connectivity.shape[1]
    n = 3 * c
    f = np.empty((3, 3))
    e = np.empty(6)
    s = np.empty(6)
    d = np.zeros((6, 6))
    slope = np.empty(6)
    step = np.empty(6)
    b = np.empty((6, n))
    db = np.empty((6, n))
    sg = np.empty((3, c))
    local_f = np.empty(n)
    local_k = np.empty((n, n))
    swelling = np.empty(n)
    geometric = np.empty((c, c))
    for k in range(solid.connectivity.shape[0]):
        local_f[:] = 0.0
        local_k[:, :] = 0.0
        swelling[:] = 0.0
        geometric[:, :] = 0.0
        nodes, averaged = solid.connectivity[k], solid.averaged[k]
        first, shear = _viscous_constants(solid, k)
        mean = _mean_volume(u, solid, k) if averaged else 0.0
        mean_before = _mean_volume(origin, solid, k) if averaged and foreseen else 0.0
        mean_step = _mean_volume_step(u, origin, solid, k) if averaged and foreseen else 0.0
        volume = 0.0
        for p in range(solid.weights.shape[1]):
            gradient = solid.gradients[k, p]
            w = solid.weights[k, p]
            volume += w
            deformation_gradient(u, nodes, gradient, f)
            green_strain(f, e)
            _stress(solid, k, p, mean, e, slope, s, d, True)
            if moving:
                add_viscous_stress(factor[k], past[k, p], first, shear, e, s)
                add_linear_tangent(first, shear, factor[k], d)
            strain_matrix(f, gradient, b)
            for m in range(6):
                ws = w * s[m]
                d0, d1, d2 = w * d[m, 0], w * d[m, 1], w * d[m, 2]
                d3, d4, d5 = w * d[m, 3], w * d[m, 4], w * d[m, 5]
                for r in range(n):
                    local_f[r] += b[m, r] * ws
                    db[m, r] = d0 * b[0, r] + d1 * b[1, r] + d2 * b[2, r] + d3 * b[3, r] + d4 * b[4, r] + d5 * b[5, r]
                if averaged:
                    for r in range(n):
                        swelling[r] += w * slope[m] * b[m, r]
            for r in range(n):
                b0, b1, b2, b3, b4, b5 = b[0, r], b[1, r], b[2, r], b[3, r], b[4, r], b[5, r]
                for q in range(r + 1):
                    local_k[r, q] += b0 * db[0, q] + b1 * db[1, q] + b2 * db[2, q] + b3 * db[3, q] + b4 * db[4, q] + b5 * db[5, q]
            if foreseen:
                _strain_step(origin, nodes, gradient, f, e, step)
                _stress(solid, k, p, mean_before, e, slope, s, d, True)
                for m in range(6):
                    for q in range(6):
                        s[m] += d[m, q] * step[q]
                if averaged:
                    pressure = bulk_modulus(solid.constants[k]) * mean_step
                    for m in range(6):
                        s[m] += pressure * slope[m]
                if moving and not damped[k]:
                    for m in range(6):
                        e[m] += step[m]
                    add_viscous_stress(factor[k], past[k, p], first, shear, e, s)
            for a in range(c):
                g0, g1, g2 = w * gradient[0, a], w * gradient[1, a], w * gradient[2, a]
                sg[0, a] = s[0] * g0 + s[3] * g1 + s[5] * g2
                sg[1, a] = s[3] * g0 + s[1] * g1 + s[4] * g2
                sg[2, a] = s[5] * g0 + s[4] * g1 + s[2] * g2
            for a in range(c):
                g0, g1, g2 = gradient[0, a], gradient[1, a], gradient[2, a]
                for q in range(a + 1):
                    geometric[a, q] += g0 * sg[0, q] + g1 * sg[1, q] + g2 * sg[2, q]
        if averaged:
            bulk = bulk_modulus(solid.constants[k]) / volume
            for r in range(n):
                for q in range(r + 1):
                    local_k[r, q] += bulk * swelling[r] * swelling[q]
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
def total_energy(u: np.ndarray, solid: Solid) -> float:
    """Return the elastic energy in J."""
    total = 0.0
    f = np.empty((3, 3))
    e = np.empty(6)
    slope = np.empty(6)
    for k in range(solid.connectivity.shape[0]):
        law, constants = solid.law[k], solid.constants[k]
        volume, sum_of_squares = 0.0, 0.0
        for p in range(solid.weights.shape[1]):
            w = solid.weights[k, p]
            deformation_gradient(u, solid.connectivity[k], solid.gradients[k, p], f)
            green_strain(f, e)
            total += w * (laws.energy(law, constants, e) + fibre_energy(solid.fibres[k, p], e))
            volume += w
            sum_of_squares += w * volume_measure(law, e, slope) ** 2
        if solid.averaged[k]:
            mean = _mean_volume(u, solid, k)
            total += mean_volume_energy(constants, volume * mean * mean, sum_of_squares)
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
def _stress(
    solid: Solid, k: int, p: int, mean: float, e: np.ndarray, slope: np.ndarray, s: np.ndarray, d: np.ndarray, tangent: bool
) -> None:
    """Write the elastic stress s (6) for the strain e (6) at point p of element k, and dS/dE into d (6, 6) if `tangent`.

    mean: mean of the element's volume measure, used where it is averaged; its derivative by the strain goes to slope (6).
    """
    laws.stress(solid.law[k], solid.constants[k], e, s, d, tangent)
    add_fibre_stress(solid.fibres[k, p], e, s, d, tangent)
    if solid.averaged[k]:
        add_mean_volume(solid.law[k], solid.constants[k], e, mean, slope, s, d, tangent)


@njit(cache=True)
def _viscous_constants(solid: Solid, k: int) -> tuple[float, float]:
    """Return Lame's constants of damping and creep in element k.

    Where the pressure is that of the mean volume, damping and creep act on the shape alone: at single points they would lock.
    Elsewhere they act on tr E at most as in a body of Poisson's ratio 0.45: tr E is the change of volume of small strains only,
    and a large strain without change of volume has tr E > 0, which a nearly incompressible body would damp many times too much.
    """
    first, shear = solid.constants[k, 0], solid.constants[k, 1]
    return (-2.0 / 3.0 * shear if solid.averaged[k] else min(first, _LARGEST_FIRST * shear)), shear


@njit(cache=True, fastmath=REORDERED)
def _mean_volume(u: np.ndarray, solid: Solid, k: int) -> float:
    """Return the mean of the volume measure in element k."""
    f, e, slope = np.empty((3, 3)), np.empty(6), np.empty(6)
    total, volume = 0.0, 0.0
    for p in range(solid.weights.shape[1]):
        deformation_gradient(u, solid.connectivity[k], solid.gradients[k, p], f)
        green_strain(f, e)
        total += solid.weights[k, p] * volume_measure(solid.law[k], e, slope)
        volume += solid.weights[k, p]
    return total / volume


@njit(cache=True, fastmath=REORDERED)
def _mean_volume_step(u: np.ndarray, origin: np.ndarray, solid: Solid, k: int) -> float:
    """Return the change of the mean of the volume measure in element k, linear in the step from `origin` to u (n, 3)."""
    f, e, step, slope = np.empty((3, 3)), np.empty(6), np.empty(6), np.empty(6)
    total, volume = 0.0, 0.0
    for p in range(solid.weights.shape[1]):
        deformation_gradient(u, solid.connectivity[k], solid.gradients[k, p], f)
        _strain_step(origin, solid.connectivity[k], solid.gradients[k, p], f, e, step)
        volume_measure(solid.law[k], e, slope)
        for m in range(6):
            total += solid.weights[k, p] * slope[m] * step[m]
        volume += solid.weights[k, p]
    return total / volume


@njit(cache=True, fastmath=REORDERED)
def _strain_step(
    origin: np.ndarray, nodes: np.ndarray, gradient: np.ndarray, f: np.ndarray, e: np.ndarray, step: np.ndarray
) -> None:
    """Write the strain e (6) at `origin` (n, 3), and the part of its change from there to f (3, 3) that is linear in the step."""
    start = np.empty((3, 3))
    moved = np.empty((3, 3))
    deformation_gradient(origin, nodes, gradient, start)
    for i in range(3):
        for j in range(3):
            moved[i, j] = f[i, j] - start[i, j]
    green_strain(start, e)
    strain_rate(start, moved, step)
