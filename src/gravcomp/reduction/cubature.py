"""Choice of the integration points and weights for the deviation of a law (`law_deviation`): empirical cubature.

The points are Gauss points of the elements. With a_ps = B_p^T T_p (r,), the deviation's force at point p in the trained shape s,
the weights solve

    min |W (sum_p w_p a_p - b)|,    b = sum over all points with their true weights,    w >= 0,    few of them not zero.

With the stiffness K_s of the body and its cables at the shape s, a force df that is in error moves the observed sections by
X df, X = S K_s^-1: W^T W = X^T X / (n L^2) + beta^2 K_s^-1 measures the error of n sections as a fraction of the length L, and a
little energy. At a bent shape the stiffness is not that of the straight robot: what stretches the shape or changes its volume may
bend the straight one, and is hundreds of times as stiff; forces that are in error there move nothing.

Of the two usual methods, energy-conserving sampling of elements (C. Farhat et al., IJNME 98, 2014) and empirical cubature at
points (J. A. Hernandez, M. A. Caicedo, A. Ferrer, CMAME 313, 2017), this is the second: an element has eight points, so a choice
of single points evaluates the law less often for the same error. The non-negative least squares of the first method are kept,
because they need no singular values of all integrands: the active set of Lawson and Hanson (1974), stopped as soon as the error
is small enough (T. Chapman et al., IJNME 109, 2017), on the normal equations. Positive weights keep the sum a sum of energies of
real points, which is stable where the law is.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.linalg import solve_triangular

from gravcomp.mechanics.kinematics import green_strain
from gravcomp.mechanics.total_lagrangian import SolidElements
from gravcomp.reduction.law_deviation import LawDeviation, deviating_stress
from gravcomp.reduction.point_gradients import mode_gradients
from gravcomp.rounding import REORDERED

# Largest number of points to choose from (a larger body offers a random part of its points), and of points at once.
_CANDIDATES, _AT_ONCE = 3000, 200
_ROUNDING = 1e-14
# The square of a column's part across the others, over its own, below which it depends on them.
_DEPENDENT = 1e-12
# beta, where the traces of both parts are equal.
_OTHERS = 0.03


@dataclass(frozen=True)
class Cubature:
    """Chosen points: element (p,), number of the point in its element (p,), weight (p,) in m^3; error: that of the choice.

    The error is the displacement of the sections that it causes, as a fraction of the length, root mean square over the shapes
    that it was chosen with.
    """

    element: np.ndarray
    point: np.ndarray
    weight: np.ndarray
    error: float = 0.0

    @staticmethod
    def none() -> "Cubature":
        """Return the cubature of a law without deviation."""
        empty = np.zeros(0, dtype=np.int64)
        return Cubature(empty, empty, np.zeros(0))

    def deviation(self, elements: SolidElements, basis: np.ndarray) -> LawDeviation:
        """Return the arrays of the points for a basis (3 n_free, r)."""
        gradient = mode_gradients(elements, basis, self.element, self.point)
        return LawDeviation(
            np.ascontiguousarray(gradient.transpose(3, 1, 2, 0).reshape(basis.shape[1], -1), dtype=np.float32),
            self.weight,
            elements.constants.law[self.element],
            _constants(elements, self.element),
        )


def choose(
    elements: SolidElements,
    basis: np.ndarray,
    coordinates: np.ndarray,
    compliance: np.ndarray,
    sections: np.ndarray,
    tolerance: float,
    room: int,
    few: int = 0,
) -> Cubature:
    """Return the cubature for a basis (3 n_free, r) and trained shapes (s, r) in its coordinates.

    compliance (s, r, r): K_s^-1; sections (n, 3, r): change of the observed sections by the coordinates, over the robot's length;
    tolerance: largest `error` of the result; room: so many points are enough where they leave at most twice as much; few: up to
    so many points, half as much is to be left.
    """
    weighing = _weighing(compliance, sections)
    element, point = (index.ravel() for index in np.indices(elements.weights.shape))
    weight = elements.weights.ravel()
    shuffled = np.random.default_rng(0).permutation(len(weight))
    candidates = np.sort(shuffled[:_CANDIDATES])
    is_candidate = np.isin(np.arange(len(weight)), candidates)
    total, columns = np.zeros(coordinates.size), []
    for start in range(0, len(weight), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        forces = _forces(elements, basis, weighing, coordinates, element[part], point[part])
        total += forces @ weight[part]
        columns.append(forces[:, is_candidate[part]])
    forces = np.hstack(columns)
    root = np.sqrt(len(coordinates))
    products = forces.T @ forces, forces.T @ total, float(total @ total)
    chosen, found, left = sparse_weights(*products, tolerance * root, room, few)
    at = candidates[chosen]
    return Cubature(element[at], point[at], found, left / root)


def _weighing(compliance: np.ndarray, sections: np.ndarray) -> np.ndarray:
    """Return W (s, r, r) for the compliances (s, r, r) and the change of the sections (n, 3, r).

    By QR from the roots of both parts: next to a soft body, what a stiff one adds to W^T W is less than its rounding error.
    """
    weighing = np.empty_like(compliance)
    for to, of in zip(weighing, compliance):
        moved = sections.reshape(-1, len(of)) @ of / np.sqrt(len(sections))
        square, direction = np.linalg.eigh(of)
        root = np.sqrt(np.maximum(square, 0.0))[:, None] * direction.T
        others = _OTHERS * np.linalg.norm(moved) / np.linalg.norm(root)
        to[:] = np.linalg.qr(np.vstack([moved, others * root]), mode="r")
    return weighing


def sparse_weights(
    gram: np.ndarray, products: np.ndarray, square: float, allowed: float, room: int, few: int = 0
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return indices (p,), positive weights (p,) and remaining |A w - b| of few columns of A for which it is at most `allowed`.

    gram A^T A (c, c); products A^T b (c,); square b^T b; room: so many columns are enough where they leave at most twice as
    much; few: up to so many columns, half as much is to be left.
    """
    scale = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    active = _ActiveSet(gram / np.outer(scale, scale), products / scale)
    left = np.sqrt(square)
    for _ in range(3 * len(products)):
        wanted = allowed if active.count >= few else 0.5 * allowed
        if left <= max(wanted, 1e-7 * np.sqrt(square)):
            break
        if active.count == room and left <= 2.0 * allowed:
            break
        gain = active.gain()
        best = int(np.argmax(gain))
        if gain[best] <= _ROUNDING * np.sqrt(square):
            break
        active.add(best)
        left = np.sqrt(max(0.0, square - active.explained))
    index, weights = active.weights()
    return index, weights / scale[index], float(left)


class _ActiveSet:
    """The columns with positive weights of a non-negative least squares problem with columns of length 1.

    The Cholesky factor of their Gram matrix grows by a row with each column, so that a column costs a solution and not a new
    decomposition; only where columns leave, the factor is made again.
    """

    def __init__(self, gram: np.ndarray, products: np.ndarray):
        """gram A^T A (c, c) and products A^T b (c,)."""
        self._gram, self._products = gram, products
        self._size = 64  # rows for which there is room
        self._index: list[int] = []
        self._lower, self._rows = np.zeros((self._size, self._size)), np.empty((self._size, len(products)))
        self._forward = np.zeros(self._size)  # L^-1 A^T b
        self._weights = np.zeros(0)
        self._dependent = np.zeros(len(products), dtype=bool)  # columns that the active ones already make up

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self._index)

    @property
    def explained(self) -> float:
        """Square of b's part that the columns represent."""
        found = self._forward[: self.count]
        return float(found @ found)

    def weights(self) -> tuple[np.ndarray, np.ndarray]:
        """Return indices (p,), ascending, and weights (p,) of the columns."""
        order = np.argsort(self._index)
        return np.array(self._index, dtype=np.int64)[order], self._weights[order]

    def gain(self) -> np.ndarray:
        """Return by how much the error falls with a small weight of each column (c,), over it; none for those in use."""
        gain = self._products - self._weights @ self._rows[: self.count]
        gain[self._index] = -np.inf
        gain[self._dependent] = -np.inf
        return gain

    def add(self, column: int) -> None:
        """Take in a column, and leave out those that would have negative weights with it."""
        if not self._appended(column):
            self._dependent[column] = True
            return
        self._weights = np.append(self._weights, 0.0)
        while True:
            k = self.count
            solved = solve_triangular(self._lower[:k, :k], self._forward[:k], lower=True, trans=1, check_finite=False)
            falling = solved <= 0.0
            if not falling.any():
                self._weights = solved
                return
            # Go toward the solution until the first weight is zero, and leave that column out.
            before = self._weights[falling]
            share = (before / (before - solved[falling])).min()
            moved = self._weights + share * (solved - self._weights)
            stays = ~(falling & (moved <= 1e-12 * moved.max()))
            self._weights = moved[stays]
            self._keep(np.array(self._index)[stays], int(np.argmin(stays)))

    def _keep(self, index: np.ndarray, same: int) -> None:
        """Factor again with some of the columns, which are independent of one another; the first `same` are where they were."""
        k = len(index)
        self._index = [int(column) for column in index]
        self._dependent[:] = False
        self._rows[same:k] = self._gram[index[same:]]
        self._lower[:k, :k] = np.linalg.cholesky(self._rows[:k][:, index])
        self._forward[:k] = solve_triangular(self._lower[:k, :k], self._products[index], lower=True, check_finite=False)

    def _appended(self, column: int) -> bool:
        """Append a column to the factor; returns whether it is independent of the others."""
        k = self.count
        if k == self._size:
            self._grow()
        row = solve_triangular(self._lower[:k, :k], self._gram[self._index, column], lower=True, check_finite=False)
        rest = self._gram[column, column] - row @ row
        if rest <= _DEPENDENT:
            return False
        self._lower[k, :k], self._lower[k, k] = row, np.sqrt(rest)
        self._forward[k] = (self._products[column] - row @ self._forward[:k]) / self._lower[k, k]
        self._rows[k] = self._gram[column]
        self._index.append(column)
        return True

    def _grow(self) -> None:
        """Make room for twice as many columns."""
        self._lower = np.pad(self._lower, (0, self._size))
        self._rows = np.vstack([self._rows, np.empty_like(self._rows)])
        self._forward = np.pad(self._forward, (0, self._size))
        self._size *= 2


def _constants(elements: SolidElements, element: np.ndarray) -> np.ndarray:
    """Return the constants (p, c) of the deviation at points of the elements (p,).

    In elements with one pressure, the deviation is that of the shape alone, with a bulk modulus of zero: the pressure of a single
    point would lock, and the polynomials already have that of the element, in the form of the law that is linear in the strain.
    """
    constants = elements.constants.values[element]
    averaged = elements.averaged[element]
    constants[averaged, 0] = -2.0 / 3.0 * constants[averaged, 1]
    return constants


def _forces(
    elements: SolidElements,
    basis: np.ndarray,
    weighing: np.ndarray,
    coordinates: np.ndarray,
    element: np.ndarray,
    point: np.ndarray,
) -> np.ndarray:
    """Return W a (s r, p) of some points, for W (s, r, r) and coordinates (s, r)."""
    gradient = mode_gradients(elements, basis, element, point)
    deformation = np.einsum("pija,sa->spij", gradient, coordinates, optimize=True) + np.eye(3)
    piola = np.empty_like(deformation)
    _piola(deformation, elements.constants.law[element], _constants(elements, element), piola)
    forces = np.einsum("spij,pija->sap", piola, gradient, optimize=True)
    return (weighing @ forces).reshape(-1, len(element))


@njit(cache=True, fastmath=REORDERED)
def _piola(deformation: np.ndarray, law: np.ndarray, constants: np.ndarray, piola: np.ndarray) -> None:
    """Write F T (s, p, 3, 3) for F (s, p, 3, 3)."""
    s, d, e, t = np.empty(6), np.empty((6, 6)), np.empty(6), np.empty((3, 3))
    for k in range(deformation.shape[0]):
        for p in range(deformation.shape[1]):
            f = deformation[k, p]
            green_strain(f, e)
            deviating_stress(law[p], constants[p], e, s, d, False)
            t[0, 0], t[1, 1], t[2, 2] = s[0], s[1], s[2]
            t[0, 1] = t[1, 0] = s[3]
            t[1, 2] = t[2, 1] = s[4]
            t[0, 2] = t[2, 0] = s[5]
            for i in range(3):
                for j in range(3):
                    piola[k, p, i, j] = f[i, 0] * t[0, j] + f[i, 1] * t[1, j] + f[i, 2] * t[2, j]
