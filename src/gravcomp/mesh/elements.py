"""The elements by kind: nodes, edges and faces, shape functions, quadrature.

hex20: serendipity hexahedron on [-1, 1]^3; tet10, tet4: tetrahedra on the unit simplex. Node order as in VTK. Reduced
integration of hex20 has 2 x 2 x 2 points (Zienkiewicz, Taylor, Too 1971): thin walls do not lock, and its spurious modes cannot
spread from one element to the next.

To add an element: its name in `KINDS`, and a branch in each function here that asks for its kind. `tube` makes every kind of
hexahedron; other elements need a mesher, or their name in meshio (`mesh_files/formats.py`). `test/test_mechanics.py` checks
every kind.
"""

import dataclasses
import functools

import numpy as np

from gravcomp.mesh.quadratic import TET_EDGES

KINDS = ("hex20", "tet10", "tet4")

_HEX_NODES = np.array(
    [
        *((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)),
        *((0, -1, -1), (1, 0, -1), (0, 1, -1), (-1, 0, -1), (0, -1, 1), (1, 0, 1), (0, 1, 1), (-1, 0, 1)),
        *((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)),
    ],
    dtype=float,
)
_HEX_EDGES = np.array([(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)])
_HEX_FACES = np.array([(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
_TET_FACES = np.array([(0, 1, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
# Barycentric coordinates of a tetrahedron as functions of (x, y, z): l = _BARY_0 + _BARY_D @ (x, y, z).
_BARY_0 = np.array([1.0, 0.0, 0.0, 0.0])
_BARY_D = np.array([[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


@dataclasses.dataclass(frozen=True)
class Quadrature:
    """Quadrature rule on the reference element: points (p, 3), weights (p,)."""

    points: np.ndarray
    weights: np.ndarray


def shape_values(kind: str, points: np.ndarray) -> np.ndarray:
    """Return the shape functions (..., c) at local points (..., 3)."""
    points = np.asarray(points, dtype=float)
    if kind == "hex20":
        x = points[..., None, :]
        a = _HEX_NODES
        on_edge = (a == 0).any(axis=-1)
        along = x * a
        factor = np.where(a == 0, 1 - x**2, 1 + along)
        product = factor[..., 0] * factor[..., 1] * factor[..., 2]
        return product * np.where(on_edge, 0.25, 0.125 * (along[..., 0] + along[..., 1] + along[..., 2] - 2))
    bary = _BARY_0 + points @ _BARY_D.T
    if kind == "tet4":
        return bary
    mids = [4 * bary[..., a] * bary[..., b] for a, b in TET_EDGES]
    return np.concatenate([bary * (2 * bary - 1), np.stack(mids, axis=-1)], axis=-1)


def shape_gradients(kind: str, points: np.ndarray) -> np.ndarray:
    """Return the derivatives (..., c, 3) of the shape functions by the local coordinates at points (..., 3)."""
    points = np.asarray(points, dtype=float)
    if kind == "hex20":
        x = points[..., None, :]
        a = _HEX_NODES
        on_edge = ~np.all(a != 0, axis=-1)
        factor = np.where(on_edge[:, None] & (a == 0), 1 - x**2, 1 + x * a)
        slope = np.where(on_edge[:, None] & (a == 0), -2 * x, np.broadcast_to(a, np.broadcast_shapes(x.shape, a.shape)))
        linear = (x * a).sum(-1) - 2
        gradient = np.empty(factor.shape)
        for i in range(3):
            others = factor[..., (i + 1) % 3] * factor[..., (i + 2) % 3]
            corner = others * (slope[..., i] * linear + factor[..., i] * a[:, i]) / 8
            gradient[..., i] = np.where(on_edge, others * slope[..., i] / 4, corner)
        return gradient
    bary = _BARY_0 + points @ _BARY_D.T
    if kind == "tet4":
        return np.broadcast_to(_BARY_D, (*points.shape[:-1], 4, 3)).copy()
    corners = (4 * bary - 1)[..., None] * _BARY_D
    mids = [4 * (bary[..., a, None] * _BARY_D[b] + bary[..., b, None] * _BARY_D[a]) for a, b in TET_EDGES]
    return np.concatenate([corners, np.stack(mids, axis=-2)], axis=-2)


def jacobians(nodes: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Return dX/dxi (k, p, 3, 3) of elements with nodes (k, c, 3) at the points of `shape_gradients` (p, c, 3)."""
    (k, c, _), p = nodes.shape, len(gradients)
    # One product of matrices, which takes a tenth of the time of sums over the same indices.
    product = nodes.transpose(0, 2, 1).reshape(3 * k, c) @ gradients.transpose(1, 0, 2).reshape(c, 3 * p)
    return product.reshape(k, 3, p, 3).transpose(0, 2, 1, 3)


def stiffness_quadrature(kind: str) -> Quadrature:
    """Return the rule for internal forces: reduced (8 points) for hex20, 4 points for tet10, one for tet4."""
    if kind == "hex20":
        return _gauss_cube(2)
    if kind == "tet10":
        inner, outer = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
        points = np.full((4, 3), inner)
        points[np.arange(3) + 1, np.arange(3)] = outer
        return Quadrature(points, np.full(4, 1 / 24))
    return Quadrature(np.full((1, 3), 0.25), np.array([1 / 6]))


def mass_quadrature(kind: str) -> Quadrature:
    """Return a rule that integrates products of two shape functions exactly on an undistorted element."""
    return _gauss_cube(3) if is_hexahedron(kind) else _conical_simplex(3)


def distance_outside(kind: str, points: np.ndarray) -> np.ndarray:
    """Return the distance (...,) of local points (..., 3) outside the reference element, zero or less inside."""
    if is_hexahedron(kind):
        return np.abs(points).max(-1) - 1.0
    return -np.minimum(points.min(-1), 1.0 - points.sum(-1))


def centre(kind: str) -> np.ndarray:
    """Return the centre (3,) of the reference element."""
    return np.zeros(3) if is_hexahedron(kind) else np.full(3, 0.25)


def reference_nodes(kind: str) -> np.ndarray:
    """Return the nodes (c, 3) of the reference element."""
    if kind == "hex20":
        return _HEX_NODES.copy()
    corners = np.vstack([np.zeros(3), np.eye(3)])
    if kind == "tet4":
        return corners
    return np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in TET_EDGES]])


def edges(kind: str) -> np.ndarray:
    """Return the ends (e, 2) of the edges as local numbers of corner nodes."""
    return _HEX_EDGES if is_hexahedron(kind) else TET_EDGES


def faces(kind: str) -> np.ndarray:
    """Return the corners (f, 3 or 4) of the faces as local node numbers, in order around each face."""
    return _HEX_FACES if is_hexahedron(kind) else _TET_FACES


def is_hexahedron(kind: str) -> bool:
    """Return whether the element is a hexahedron on [-1, 1]^3, otherwise a tetrahedron on the unit simplex."""
    return kind == "hex20"


def constant_strain(kind: str) -> bool:
    """Return whether the strain is constant in an element: such elements lock in bending, and are solved corotationally."""
    return kind == "tet4"


@functools.cache
def _gauss_cube(n: int) -> Quadrature:
    """Return Gauss's rule with n x n x n points on the cube."""
    x, w = np.polynomial.legendre.leggauss(n)
    points = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return _fixed(points, np.einsum("i,j,k->ijk", w, w, w).ravel())


@functools.cache
def _conical_simplex(n: int) -> Quadrature:
    """Return Stroud's conical product rule, the cube mapped to the simplex, exact to degree 2 n - 1."""
    from scipy.special import roots_jacobi

    rules = []
    for power in range(3):
        x, w = roots_jacobi(n, power, 0)
        rules.append(((1 + x) / 2, w / 2 ** (power + 1)))
    (a, wa), (b, wb), (c, wc) = rules
    c, b, a = np.meshgrid(c, b, a, indexing="ij")
    points = np.stack([c, b * (1 - c), a * (1 - b) * (1 - c)], axis=-1).reshape(-1, 3)
    return _fixed(points, np.einsum("i,j,k->ijk", wc, wb, wa).ravel())


def _fixed(points: np.ndarray, weights: np.ndarray) -> Quadrature:
    """Return the rule with arrays that cannot be changed: all who ask for it share them."""
    points.flags.writeable = weights.flags.writeable = False
    return Quadrature(points, weights)
