"""Internal forces and tangent stiffness of solid elements, total Lagrangian, compiled by Numba.

At every quadrature point, with F = I + du/dX, E = (F^T F - I) / 2 and S the second Piola-Kirchhoff stress (Bathe 1996, 6.3):

    f = sum w B^T S,      K = sum w (B^T D B + grad N . S grad N),      D = dS/dE,   B = dE/dq.

S and D are those of `material_laws`. Damping and creep add C : (a E - b) with C of linear elasticity and a and b from
the strains of the steps before (see `simulation.viscosity`): they see strain alone, so a rotating body is not braked, and the
tangent stays symmetric and exact.
"""

import dataclasses

import numpy as np
from numba import njit

from gravcomp.mechanics.block_matrix import BlockMatrix, BlockPattern
from gravcomp.mechanics.material_laws import FAST, Lame, add_linear_tangent, inverse_cauchy_green, linear_stress, stress
from gravcomp.mesh import Mesh, MeshError
from gravcomp.mesh.elements import mass_quadrature, shape_gradients, shape_values, stiffness_quadrature


@dataclasses.dataclass(frozen=True)
class ViscousStrain:
    """factor E - past at every quadrature point, whose linear stress is that of damping and creep: factor (k,), past (k, p, 6)."""

    factor: np.ndarray
    past: np.ndarray


class SolidElements:
    """The elements of a mesh whose nodes are in the pattern's order, the clamped ones last."""

    def __init__(self, mesh: Mesh, pattern: BlockPattern):
        self.mesh = mesh
        self.lame = Lame.of(mesh)
        self.n_free = pattern.n // 3
        rule = stiffness_quadrature(mesh.kind)
        self.gradients, self.weights = _reference_geometry(mesh, rule.points, rule.weights)
        self._connectivity = mesh.elements.astype(np.int64)
        self._position = _scatter_positions(mesh.elements, pattern, self.n_free)
        self._elastic = ViscousStrain(np.zeros(len(self.weights)), np.zeros((*self.weights.shape, 6)))

    def internal_force(self, u: np.ndarray, viscous: ViscousStrain | None = None) -> np.ndarray:
        """Internal forces (n, 3) in N at displacements `u` (n, 3), with damping and creep when a viscous strain is given."""
        force = np.zeros_like(u)
        strain = viscous or self._elastic
        _internal_force(
            u, viscous is not None, strain.factor, strain.past, self._connectivity, self.gradients, self.weights,
            self.lame.law, self.lame.first, self.lame.shear, force,
        )  # fmt: skip
        return force

    def assemble(
        self,
        u: np.ndarray,
        matrix: BlockMatrix,
        viscous: ViscousStrain | None = None,
        origin: np.ndarray | None = None,
    ) -> np.ndarray:
        """Internal forces (n, 3); the tangent stiffness is added to `matrix`.

        With `origin` (n, 3), the displacements of the last iterate, the stress in grad N . S grad N is that which the last
        Newton step foresaw, S(E + B du): the stretch that a straight step through a curved path leaves behind then does not
        stiffen the next step (Magisano, Leonetti, Garcea 2017, mixed integration points). The stress of damping is left out
        of that term then: along the axis it is an artefact of the iteration and could make the tangent indefinite.
        """
        force = np.zeros_like(u)
        strain = viscous or self._elastic
        foreseen = origin is not None
        _assemble(
            u, viscous is not None, strain.factor, strain.past, origin if foreseen else u, foreseen, self._connectivity,
            self.gradients, self.weights, self.lame.law, self.lame.first, self.lame.shear, force, self._position, matrix.values,
        )  # fmt: skip
        return force

    def strains(self, u: np.ndarray) -> np.ndarray:
        """(k, p, 6) Green's strain at the quadrature points, in the order 11 22 33 12 23 13, shear doubled."""
        strain = np.empty((*self.weights.shape, 6))
        _strains(u, self._connectivity, self.gradients, strain)
        return strain

    def smallest_volume_ratio(self, u: np.ndarray) -> float:
        """The least det F of all quadrature points; below zero an element is turned inside out."""
        return _smallest_volume_ratio(u, self._connectivity, self.gradients)

    def energy(self, u: np.ndarray) -> float:
        """Elastic energy in J."""
        return _energy(u, self._connectivity, self.gradients, self.weights, self.lame.law, self.lame.first, self.lame.shear)

    def nodal_mass(self) -> np.ndarray:
        """(n,) integral of density times shape function in kg: what gravity pulls at; it may be negative at corners."""
        values, weights = self._mass_rule()
        mass = np.zeros(len(self.mesh.nodes))
        np.add.at(mass, self.mesh.elements, np.einsum("kp,pa,k->ka", weights, values, self.lame.density))
        return mass

    def element_mass(self) -> np.ndarray:
        """(k, c, c) consistent mass of every element, between its nodes."""
        values, weights = self._mass_rule()
        return np.einsum("kp,pa,pb,k->kab", weights, values, values, self.lame.density, optimize=True)

    def add_mass(self, matrix: BlockMatrix, factor: float) -> None:
        """Add factor x consistent mass to `matrix`."""
        _scatter_diagonal(self.element_mass() * factor, self._position, matrix.values)

    def _mass_rule(self) -> tuple[np.ndarray, np.ndarray]:
        rule = mass_quadrature(self.mesh.kind)
        _, weights = _reference_geometry(self.mesh, rule.points, rule.weights)
        return shape_values(self.mesh.kind, rule.points), weights


def _reference_geometry(mesh: Mesh, points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradients (k, p, 3, c) by rest coordinates and weights (k, p) in m^3. Raises MeshError for inverted elements."""
    local = shape_gradients(mesh.kind, points)
    jacobian = np.einsum("kai,paj->kpij", mesh.nodes[mesh.elements], local)
    volume = np.linalg.det(jacobian)
    if (volume <= 0).any():
        bad = np.flatnonzero((volume <= 0).any(axis=1))
        raise MeshError(f"{len(bad)} of {len(volume)} elements are inverted or flat (the first is number {bad[0]})")
    gradients = np.einsum("paj,kpji->kpia", local, np.linalg.inv(jacobian))
    return np.ascontiguousarray(gradients), volume * weights


def _scatter_positions(elements: np.ndarray, pattern: BlockPattern, n_free: int) -> np.ndarray:
    """(k, d (d + 1) / 2): where the lower triangle of each element's matrix goes, -1 for clamped unknowns.

    Unknowns of an element are ordered component by component, x of all nodes first.
    """
    unknown = np.concatenate([3 * elements + i for i in range(3)], axis=1)
    row, column = np.tril_indices(unknown.shape[1])
    rows, columns = unknown[:, row], unknown[:, column]
    free = (rows < 3 * n_free) & (columns < 3 * n_free)
    position = np.full(rows.shape, -1, dtype=np.int64)
    position[free] = pattern.position(rows[free], columns[free])
    return position.astype(np.int32)


@njit(cache=True, fastmath=FAST)
def _kinematics(u, nodes, gradient, f):
    """Add sum u grad N of one point to f (3, 3)."""
    for a in range(nodes.shape[0]):
        for i in range(3):
            value = u[nodes[a], i]
            for j in range(3):
                f[i, j] += value * gradient[j, a]


@njit(cache=True, fastmath=FAST)
def _strain(f, e):
    """Green's strain (6) in the order 11 22 33 12 23 13, shear doubled."""
    for k in range(3):
        e[k] = 0.5 * (f[0, k] * f[0, k] + f[1, k] * f[1, k] + f[2, k] * f[2, k] - 1.0)
    e[3] = f[0, 0] * f[0, 1] + f[1, 0] * f[1, 1] + f[2, 0] * f[2, 1]
    e[4] = f[0, 1] * f[0, 2] + f[1, 1] * f[1, 2] + f[2, 1] * f[2, 2]
    e[5] = f[0, 0] * f[0, 2] + f[1, 0] * f[1, 2] + f[2, 0] * f[2, 2]


@njit(cache=True, fastmath=FAST)
def _strain_rate(f, g, e):
    """Rate of Green's strain (6) for the rate g (3, 3) of the deformation gradient f."""
    for k in range(3):
        e[k] = f[0, k] * g[0, k] + f[1, k] * g[1, k] + f[2, k] * g[2, k]
    for k, i, j in ((3, 0, 1), (4, 1, 2), (5, 0, 2)):
        e[k] = 0.0
        for m in range(3):
            e[k] += f[m, i] * g[m, j] + g[m, i] * f[m, j]


@njit(cache=True, fastmath=FAST)
def _strain_matrix(f, gradient, b):
    """dE/dq into b (6, 3 c), unknowns component by component."""
    c = gradient.shape[1]
    for i in range(3):
        f0, f1, f2 = f[i, 0], f[i, 1], f[i, 2]
        for a in range(c):
            g0, g1, g2 = gradient[0, a], gradient[1, a], gradient[2, a]
            column = i * c + a
            b[0, column] = f0 * g0
            b[1, column] = f1 * g1
            b[2, column] = f2 * g2
            b[3, column] = f0 * g1 + f1 * g0
            b[4, column] = f1 * g2 + f2 * g1
            b[5, column] = f0 * g2 + f2 * g0


@njit(cache=True, fastmath=FAST)
def _viscous_stress(factor, past, first, shear, e, s):
    """Add the stress of damping and creep for the strain e (6) to s (6)."""
    viscous = np.empty(6)
    for m in range(6):
        viscous[m] = factor * e[m] - past[m]
    linear_stress(first, shear, viscous, s)


@njit(cache=True, fastmath=FAST)
def _point(u, moving, factor, past, nodes, gradient, law, first, shear, f, e, s, d, tangent):
    """Deformation gradient f, strain e and stress s (with damping) at one point; elastic dS/dE in d when `tangent`."""
    f[:, :] = 0.0
    for i in range(3):
        f[i, i] = 1.0
    _kinematics(u, nodes, gradient, f)
    _strain(f, e)
    stress(law, first, shear, e, s, d, tangent)
    if moving:
        _viscous_stress(factor, past, first, shear, e, s)


@njit(cache=True, fastmath=FAST)
def _strains(u, connectivity, gradients, strain):
    f = np.empty((3, 3))
    for k in range(connectivity.shape[0]):
        for p in range(gradients.shape[1]):
            f[:, :] = 0.0
            for i in range(3):
                f[i, i] = 1.0
            _kinematics(u, connectivity[k], gradients[k, p], f)
            _strain(f, strain[k, p])


@njit(cache=True, fastmath=FAST)
def _foreseen_stress(u, origin, nodes, gradient, law, first, shear, f, e, s, d):
    """Stress s (6) for the strain that is linear in the step from `origin` to u, where f (3, 3) is reached."""
    start = np.eye(3)
    step = np.empty((3, 3))
    _kinematics(origin, nodes, gradient, start)
    for i in range(3):
        for j in range(3):
            step[i, j] = f[i, j] - start[i, j]
    rate = np.empty(6)
    _strain(start, e)
    _strain_rate(start, step, rate)
    for m in range(6):
        e[m] += rate[m]
    stress(law, first, shear, e, s, d, False)


@njit(cache=True, fastmath=FAST)
def _internal_force(u, moving, factor, past, connectivity, gradients, weights, law, first, shear, force):
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
            _point(u, moving, factor[k], past[k, p], nodes, gradient, law[k], first[k], shear[k], f, e, s, d, False)
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


@njit(cache=True, fastmath=FAST)
def _assemble(
    u, moving, factor, past, origin, foreseen, connectivity, gradients, weights, law, first, shear, force, position, values,
):  # fmt: skip
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
            _point(u, moving, factor[k], past[k, p], nodes, gradient, law[k], first[k], shear[k], f, e, s, d, True)
            if moving:
                add_linear_tangent(first[k], shear[k], factor[k], d, False)
            _strain_matrix(f, gradient, b)
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
                _foreseen_stress(u, origin, nodes, gradient, law[k], first[k], shear[k], f, e, s, d)
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


@njit(cache=True)
def _scatter_diagonal(local, position, values):
    """Add matrices (k, c, c) between nodes, equal in x, y and z, to the values."""
    c = local.shape[1]
    for k in range(local.shape[0]):
        for i in range(3):
            for a in range(c):
                row = i * c + a
                for q in range(a + 1):
                    target = position[k, row * (row + 1) // 2 + i * c + q]
                    if target >= 0:
                        values[target] += local[k, a, q]


@njit(cache=True)
def _smallest_volume_ratio(u, connectivity, gradients):
    least = np.inf
    f = np.empty((3, 3))
    for k in range(connectivity.shape[0]):
        for p in range(gradients.shape[1]):
            f[:, :] = 0.0
            for i in range(3):
                f[i, i] = 1.0
            _kinematics(u, connectivity[k], gradients[k, p], f)
            det = (
                f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
                - f[0, 1] * (f[1, 0] * f[2, 2] - f[1, 2] * f[2, 0])
                + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0])
            )
            if not det > least:  # NaN is the least of all
                least = det
            if det != det:
                return -np.inf
    return least


@njit(cache=True, fastmath=FAST)
def _energy(u, connectivity, gradients, weights, law, first, shear):
    total = 0.0
    f = np.empty((3, 3))
    e = np.empty(6)
    c = np.empty(6)
    ci = np.empty(6)
    for k in range(connectivity.shape[0]):
        for p in range(weights.shape[1]):
            f[:, :] = 0.0
            for i in range(3):
                f[i, i] = 1.0
            _kinematics(u, connectivity[k], gradients[k, p], f)
            _strain(f, e)
            if law[k] == 0:
                trace = e[0] + e[1] + e[2]
                square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + 0.5 * (e[3] * e[3] + e[4] * e[4] + e[5] * e[5])
                density = 0.5 * first[k] * trace * trace + shear[k] * square
            else:
                j = inverse_cauchy_green(e, c, ci)
                bulk = first[k] + 2.0 / 3.0 * shear[k]
                density = 0.5 * shear[k] * (j ** (-2.0 / 3.0) * (c[0] + c[1] + c[2]) - 3.0) + 0.5 * bulk * (j - 1.0) ** 2
            total += weights[k, p] * density
    return total
