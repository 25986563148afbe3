"""Corotational linear tetrahedra: the kind of model that the article uses, kept as a baseline for comparison.

Per element, with the rotation R of the polar decomposition F = R U (Mueller and Gross 2004),

    f = R K_0 (R^T x - X),      K = R K_0 R^T,

where K_0 is the stiffness of linear elasticity. The derivative of R is neglected, as real-time codes do. Such meshes lock: they
are too stiff in bending.
"""

import numpy as np
from numba import njit

from gravcomp.mechanics.block_matrix import BlockMatrix, BlockPattern
from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.mechanics.viscous_strain import ViscousStrain
from gravcomp.mesh import Mesh


class CorotationalElements(SolidElements):
    """Linear tetrahedra with the interface of SolidElements, without the damping of the material."""

    def __init__(self, mesh: Mesh, pattern: BlockPattern):
        super().__init__(mesh, pattern)
        matrix = _strain_displacement(self.gradients[:, 0])
        first, shear = self.constants.first[:, None, None], self.constants.shear[:, None, None]
        block = np.zeros((6, 6))
        block[:3, :3] = 1.0
        elasticity = first * block + shear * np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
        self._stiffness = np.einsum("k,kmi,kmn,knj->kij", self.weights[:, 0], matrix, elasticity, matrix, optimize=True)
        self._gradient = np.ascontiguousarray(self.gradients[:, 0])

    def scale_stiffness(self, factor: np.ndarray) -> None:
        """Multiply the modulus of every element by `factor` (k,)."""
        super().scale_stiffness(factor)
        self._stiffness *= factor[:, None, None]

    def internal_force(self, u: np.ndarray, viscous: ViscousStrain | None = None) -> np.ndarray:
        """Return internal forces (n, 3) in N at displacements `u` (n, 3); `viscous` is ignored."""
        force = np.zeros_like(u)
        _corotational(
            u, self.mesh.nodes, self._connectivity, self._gradient, self._stiffness, force, False, self._position, np.zeros(0)
        )
        return force

    def assemble(
        self,
        u: np.ndarray,
        matrix: BlockMatrix,
        viscous: ViscousStrain | None = None,
        origin: np.ndarray | None = None,
    ) -> np.ndarray:
        """Add the stiffness at `u` (n, 3) to `matrix` and return internal forces (n, 3) in N; the other arguments are ignored."""
        force = np.zeros_like(u)
        _corotational(
            u, self.mesh.nodes, self._connectivity, self._gradient, self._stiffness, force, True, self._position,
            matrix.values,
        )  # fmt: skip
        return force


def _strain_displacement(gradient: np.ndarray) -> np.ndarray:
    """Return (k, 6, 12) the derivative of small strain by the unknowns, component by component, for gradients (k, 3, 4)."""
    b = np.zeros((len(gradient), 6, 3, 4))
    for i in range(3):
        b[:, i, i] = gradient[:, i]
    for row, (i, j) in zip((3, 4, 5), ((0, 1), (1, 2), (0, 2))):
        b[:, row, i] = gradient[:, j]
        b[:, row, j] = gradient[:, i]
    return b.reshape(len(gradient), 6, 12)


@njit(cache=True)
def _rotation(f: np.ndarray, r: np.ndarray) -> None:
    """Write the rotation of the polar decomposition of f (3, 3) into r, by Higham's Newton iteration."""
    r[:, :] = f
    inverse = np.empty((3, 3))
    for _ in range(20):
        for i in range(3):
            i1, i2 = (i + 1) % 3, (i + 2) % 3
            for j in range(3):
                j1, j2 = (j + 1) % 3, (j + 2) % 3
                inverse[i, j] = r[i1, j1] * r[i2, j2] - r[i1, j2] * r[i2, j1]
        det = r[0, 0] * inverse[0, 0] + r[0, 1] * inverse[0, 1] + r[0, 2] * inverse[0, 2]
        change = 0.0
        for i in range(3):
            for j in range(3):
                new = 0.5 * (r[i, j] + inverse[i, j] / det)
                change = max(change, abs(new - r[i, j]))
                r[i, j] = new
        if change < 1e-12:
            break


@njit(cache=True)
def _corotational(
    u: np.ndarray, rest: np.ndarray, connectivity: np.ndarray, gradient: np.ndarray, stiffness: np.ndarray, force: np.ndarray,
    tangent: bool, position: np.ndarray, values: np.ndarray,
) -> None:  # fmt: skip
    """Add internal forces to force (n, 3), and, if `tangent`, stiffness to `values` at `position`."""
    f, r = np.empty((3, 3)), np.empty((3, 3))
    local, moved = np.empty(12), np.empty(12)
    rotated = np.empty((12, 12))
    for k in range(connectivity.shape[0]):
        nodes = connectivity[k]
        f[:, :] = 0.0
        for i in range(3):
            f[i, i] = 1.0
            for j in range(3):
                for a in range(4):
                    f[i, j] += u[nodes[a], i] * gradient[k, j, a]
        _rotation(f, r)
        for a in range(4):
            for i in range(3):
                value = -rest[nodes[a], i]
                for j in range(3):
                    value += r[j, i] * (rest[nodes[a], j] + u[nodes[a], j])
                local[i * 4 + a] = value
        for row in range(12):
            value = 0.0
            for column in range(12):
                value += stiffness[k, row, column] * local[column]
            moved[row] = value
        for a in range(4):
            for i in range(3):
                for j in range(3):
                    force[nodes[a], i] += r[i, j] * moved[j * 4 + a]
        if not tangent:
            continue
        for a in range(4):  # R K_0 R^T, node by node
            for b in range(4):
                for i in range(3):
                    for j in range(3):
                        value = 0.0
                        for m in range(3):
                            for n in range(3):
                                value += r[i, m] * stiffness[k, m * 4 + a, n * 4 + b] * r[j, n]
                        rotated[i * 4 + a, j * 4 + b] = value
        entry = 0
        for row in range(12):
            for column in range(row + 1):
                target = position[k, entry]
                entry += 1
                if target >= 0:
                    values[target] += rotated[row, column]
