"""Reduced elasticity of the St. Venant-Kirchhoff law: the strain as exact polynomials of the reduced coordinates.

For the other laws it is the elasticity that is linear in Green's strain, to which `law_deviation` adds the rest.

With u = sum_i phi_i q_i and G_i = grad phi_i, Green's strain is quadratic, E = sum e_i q_i + 1/2 sum e_ij q_i q_j with
e_i = sym G_i and e_ij = sym G_i^T G_j. It is taken in a basis of strains s_m that is orthonormal in the elastic energy
<a, b> = int a : C : b, as in the methods of assumed strain (Simo and Rifai 1990):

    eps_m(q) = <s_m, E(q)> = a_m . q + 1/2 q . B_m q,    a_mi = <s_m, e_i>,    B_mij = <s_m, e_ij>,
    energy U = 1/2 sum eps_m^2,    f = J^T eps,    K = J^T J + sum eps_m B_m,    J = a + B q.

The integrals are exact; nothing is sampled. With a complete set of s_m, U would be the exact polynomial of degree four (Barbic
and James 2005). Only the r strains e_i, which make the stiffness at rest exact, and the principal strains of the trained shapes
are taken. That is more accurate: a combination of a few modes cannot bend without a small stretch that the real body does not
have, and with all strains these stretches make the reduced body too stiff. It is also cheaper, m r^2 products instead of r^4 /
4. The Kelvin-Voigt law with the time beta is the stress eps + beta d eps / dt.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.reduction.basis import principal_combinations
from gravcomp.reduction.point_gradients import on_nodes
from gravcomp.rounding import REORDERED

# Voigt's order 11 22 33 12 23 13 with doubled shear, as in the elements.
_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 1, 0]), np.array([0, 1, 2, 1, 2, 2])
_POINTS_AT_ONCE = 400


@dataclass(frozen=True)
class StrainPolynomials:
    """linear a^T (r, m) and quadratic B^T (r (r + 1) / 2, m) in sqrt(J); the latter holds the lower half of each B_m row by row.

    The strains run along the last axis, so that a step reads memory in order. B is in single precision, because reading it takes
    most of the time of a step; force and stiffness are still exact derivatives of one energy.
    """

    linear: np.ndarray
    quadratic: np.ndarray

    def of_first(self, modes: int, extra: int) -> "StrainPolynomials":
        """Return those on the first modes, with the strains of these and the first `extra` principal ones."""
        r, m = self.linear.shape
        strains, pairs = np.r_[0:modes, r : min(m, r + extra)], modes * (modes + 1) // 2
        return StrainPolynomials(
            np.ascontiguousarray(self.linear[:modes, strains]), np.ascontiguousarray(self.quadratic[:pairs, strains])
        )


@njit(cache=True)
def _packed(i: int, j: int) -> int:
    """Return the position of the entry (i, j) of a symmetric matrix in its lower half, stored row by row."""
    return i * (i + 1) // 2 + j if j <= i else j * (j + 1) // 2 + i


@njit(cache=True, fastmath=REORDERED)
def strain_at(linear: np.ndarray, quadratic: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return J^T (r, m) and eps (m,) at q (r,)."""
    r, modes = linear.shape
    jacobian, strain = linear.copy(), np.zeros(modes)
    for i in range(r):
        # Entries (i, j) of the packed symmetric matrices, four at a time: the row of the result is read and written less often.
        to, j = jacobian[i], 0
        while j + 4 <= r:
            p_0, p_1, p_2, p_3 = _packed(i, j), _packed(i, j + 1), _packed(i, j + 2), _packed(i, j + 3)
            b_0, b_1, b_2, b_3 = quadratic[p_0], quadratic[p_1], quadratic[p_2], quadratic[p_3]
            q_0, q_1, q_2, q_3 = q[j], q[j + 1], q[j + 2], q[j + 3]
            for m in range(modes):
                to[m] += b_0[m] * q_0 + b_1[m] * q_1 + b_2[m] * q_2 + b_3[m] * q_3
            j += 4
        while j < r:
            b_0, q_0 = quadratic[_packed(i, j)], q[j]
            for m in range(modes):
                to[m] += b_0[m] * q_0
            j += 1
    for i in range(r):
        half, constant, whole = 0.5 * q[i], linear[i], jacobian[i]
        for m in range(modes):
            strain[m] += half * (constant[m] + whole[m])
    return jacobian, strain


@njit(cache=True, fastmath=REORDERED)
def tangent(jacobian: np.ndarray, quadratic: np.ndarray, stress: np.ndarray, scale: float) -> np.ndarray:
    """Return the lower triangle of scale J^T J + sum stress_m B_m (r, r), from J^T (r, m) and the stress (m,)."""
    r, modes = jacobian.shape
    stiffness = np.empty((r, r))
    row, pair = np.empty(modes), 0
    for i in range(r):
        for m in range(modes):
            row[m] = scale * jacobian[i, m]
        # Four entries at a time: shared values are read once.
        j = 0
        while j + 4 <= i + 1:
            j_0, j_1, j_2, j_3 = jacobian[j], jacobian[j + 1], jacobian[j + 2], jacobian[j + 3]
            b_0, b_1, b_2, b_3 = quadratic[pair], quadratic[pair + 1], quadratic[pair + 2], quadratic[pair + 3]
            k_0 = k_1 = k_2 = k_3 = 0.0
            for m in range(modes):
                x, s = row[m], stress[m]
                k_0 += x * j_0[m] + s * b_0[m]
                k_1 += x * j_1[m] + s * b_1[m]
                k_2 += x * j_2[m] + s * b_2[m]
                k_3 += x * j_3[m] + s * b_3[m]
            stiffness[i, j], stiffness[i, j + 1], stiffness[i, j + 2], stiffness[i, j + 3] = k_0, k_1, k_2, k_3
            j, pair = j + 4, pair + 4
        while j <= i:
            j_0, b_0, k_0 = jacobian[j], quadratic[pair], 0.0
            for m in range(modes):
                k_0 += row[m] * j_0[m] + stress[m] * b_0[m]
            stiffness[i, j] = k_0
            j, pair = j + 1, pair + 1
    return stiffness


def strain_polynomials(elements: SolidElements, basis: np.ndarray, snapshots: np.ndarray, extra: int) -> StrainPolynomials:
    """Return the polynomials for a basis (3 n_free, r) that is orthonormal in the energy at rest.

    snapshots (s, 3 n_free): trained shapes; their `extra` principal strains are used in addition to those of the basis.
    """
    r, s = basis.shape[1], len(snapshots)
    gram, shares = np.zeros((s, s)), np.zeros((r, s))
    for points in _parts(elements, basis, snapshots):
        stress = points.stress(points.strains)
        gram += points.strains.T @ stress
        shares += points.linear.T @ stress
    combination = principal_combinations(gram - shares.T @ shares, extra)
    known = shares @ combination
    linear = np.zeros((r + combination.shape[1], r))
    first, second = np.tril_indices(r)
    pairs = np.zeros((len(linear), first.size))
    for points in _parts(elements, basis, snapshots):
        strains = np.hstack([points.linear, points.strains @ combination - points.linear @ known])
        stress = points.stress(strains)
        linear += stress.T @ points.linear
        pairs += stress.T @ points.products(first, second)
    return StrainPolynomials(np.ascontiguousarray(linear.T), np.ascontiguousarray(pairs.T, dtype=np.float32))


@dataclass(frozen=True)
class _Points:
    """A part of the quadrature points.

    gradient (p, 3, 3, r) of the modes; linear (6 p, r): their linear strains; strains (6 p, s) of the snapshots; first_lame,
    shear and weight (p,); fibres (p, f, 6); averaged (p,): points of elements with one pressure; together: number of points of an
    element.
    """

    gradient: np.ndarray
    linear: np.ndarray
    strains: np.ndarray
    first_lame: np.ndarray
    shear: np.ndarray
    weight: np.ndarray
    fibres: np.ndarray
    averaged: np.ndarray
    together: int

    def stress(self, strains: np.ndarray) -> np.ndarray:
        """Return C : strains (6 p, k), times the weights of the points; C includes the fibres."""
        strains = strains.reshape(len(self.weight), 6, -1)
        stress = self.shear[:, None, None] * strains
        trace = strains[:, :3].sum(axis=1)
        stress[:, :3] = 2.0 * stress[:, :3] + (self.first_lame[:, None] * trace)[:, None, :]
        if self.averaged.any():  # the pressure is that of the element's mean volume
            shape = -1, self.together
            weight = self.weight.reshape(shape)
            mean = np.einsum("ep,epk->ek", weight, trace.reshape(*weight.shape, -1)) / weight.sum(axis=1, keepdims=True)
            bulk = np.where(self.averaged, self.first_lame + 2.0 / 3.0 * self.shear, 0.0)
            stress[:, :3] += (bulk[:, None] * (np.repeat(mean, self.together, axis=0) - trace))[:, None, :]
        if self.fibres.shape[1]:
            stress += np.einsum("pfm,pfn,pnk->pmk", self.fibres, self.fibres, strains, optimize=True)
        return (stress * self.weight[:, None, None]).reshape(6 * len(self.weight), -1)

    def products(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return e_ij (6 p, k) of the pairs i = first (k,), j = second (k,)."""
        return _voigt(np.einsum("pkia,pkja->pija", self.gradient[..., first], self.gradient[..., second], optimize=True))


def _parts(elements: SolidElements, basis: np.ndarray, snapshots: np.ndarray) -> Iterator[_Points]:
    """Yield the quadrature points in parts that fit into memory."""
    count = elements.weights.shape[1]
    at_once = max(1, _POINTS_AT_ONCE // count)
    modes, shapes = on_nodes(elements, basis), on_nodes(elements, snapshots.T)
    for start in range(0, len(elements.weights), at_once):
        part = slice(start, start + at_once)
        gradient, moved = _gradient(elements, part, modes), _gradient(elements, part, shapes)
        yield _Points(
            gradient=gradient,
            linear=_voigt(gradient),
            strains=_voigt(moved + 0.5 * np.einsum("pkia,pkja->pija", moved, moved, optimize=True)),
            first_lame=np.repeat(elements.constants.first[part], count),
            shear=np.repeat(elements.constants.shear[part], count),
            weight=elements.weights[part].ravel(),
            fibres=np.concatenate(elements.fibres[part]),
            averaged=np.repeat(elements.averaged[part], count),
            together=count,
        )


def _gradient(elements: SolidElements, part: slice, fields: np.ndarray) -> np.ndarray:
    """Return d field_i / d X_j (p, 3, 3, k) at the points of some elements."""
    local = fields[elements.mesh.elements[part]]
    gradient = np.einsum("kpjc,kcia->kpija", elements.gradients[part], local, optimize=True)
    return gradient.reshape(-1, 3, 3, fields.shape[-1])


def _voigt(tensor: np.ndarray) -> np.ndarray:
    """Return the symmetric part of (p, 3, 3, k) as strain (6 p, k)."""
    symmetric = 0.5 * (tensor[:, _ROWS, _COLUMNS] + tensor[:, _COLUMNS, _ROWS])
    symmetric[:, 3:] *= 2.0
    return symmetric.reshape(-1, tensor.shape[-1])
