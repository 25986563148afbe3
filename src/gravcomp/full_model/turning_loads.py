"""Newton's tangent with loads that turn with their sections, or that springs bring.

Such a load depends on the unknowns only by s = (p, f_1, f_2) of its section, s = S u, so its part of the tangent has a low rank:

    (K - S^T J S) y = r      with      J = d pulls / d s (9, 9) of each section.

The symmetric part H of J is added to the stiffness before it is factorised: at some equilibria only K - S^T H S is positive
definite. The factor is enough for the rest (Woodbury 1950): y = y_0 + Z a, y_0 = (K - S^T H S)^-1 r, Z = (K - S^T H S)^-1 S^T
(J - H), (1 - S Z) a = S y_0.
"""

import numpy as np

from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.spring import Spring
from gravcomp.full_model.wrench import PointLoads, Wrench
from gravcomp.mechanics.block_matrix import BlockMatrix, Factor

_SMALL = 1e-6  # of |f_1|: the steps of the central differences


class TurningFactor:
    """A factor that solves with K - S^T J S."""

    def __init__(self, factor: Factor, loads: PointLoads, slopes: list[np.ndarray], contained: list[np.ndarray]):
        """slopes: J (9, 9) of each turning load; contained: the part H of it that the factor contains."""
        self._factor = factor
        self._rows = [rows[:, : loads.model.n_free] for _, rows in loads.turning]
        left = [
            np.einsum("vn,vij->nij", rows, (j - h).reshape(3, 3, 9)).reshape(-1, 9)
            for rows, j, h in zip(self._rows, slopes, contained)
        ]
        self._answer = factor.solve(np.concatenate(left, axis=1))
        self._inner = np.eye(self._answer.shape[1]) - self._seen(self._answer)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solution (3 n_free,) or (3 n_free, k) for the right-hand sides."""
        first = self._factor.solve(right)
        result: np.ndarray = first + self._answer @ np.linalg.solve(self._inner, self._seen(first))
        return result

    def _seen(self, field: np.ndarray) -> np.ndarray:
        """Return the changes of p, f_1 and f_2 of all sections, (9 k,) or (9 k, columns)."""
        values = field.reshape(self._rows[0].shape[1], 3, -1)
        found = np.concatenate([np.tensordot(rows, values, axes=1).reshape(9, -1) for rows in self._rows])
        return found if field.ndim == 2 else found[:, 0]


def slopes_of(loads: PointLoads, u: np.ndarray, fraction: float) -> list[np.ndarray]:
    """Return J (9, 9) of each turning load at the displacements u (n, 3), for `fraction` of the loads."""
    found = []
    for wrench, rows in loads.turning:
        if isinstance(wrench, Spring):
            found.append(fraction * wrench.slopes)
        else:
            found.append(fraction * _slopes(wrench, *(rows @ (loads.model.mesh.nodes + u))))
    return found


def add_symmetric_part(matrix: BlockMatrix, loads: PointLoads, slopes: list[np.ndarray]) -> list[np.ndarray]:
    """Add -S^T H S to the stiffness; return H (9, 9) of each load, zeros where the matrix has no entries for its section."""
    parts = [0.5 * (slope + slope.T) for slope in slopes]
    return [
        part if add_part(matrix, loads.model, rows, part) else np.zeros((9, 9)) for (_, rows), part in zip(loads.turning, parts)
    ]


def add_part(matrix: BlockMatrix, model: MeshedModel, rows: np.ndarray, part: np.ndarray) -> bool:
    """Add -S^T H S to the stiffness, with `part` H (3 v, 3 v) and the rows (v, n) of S; False where it has no entries there."""
    rows, v = rows[:, : model.n_free], len(rows)
    nodes = np.flatnonzero(rows.any(axis=0))
    by_node = np.einsum("vn,viwj,wm->nimj", rows[:, nodes], part.reshape(v, 3, v, 3), rows[:, nodes], optimize=True)
    values = by_node.reshape(3 * len(nodes), -1)
    unknowns = (3 * nodes[:, None] + np.arange(3)).ravel()
    row, column = np.tril_indices(len(unknowns))
    try:
        position = matrix.pattern.position(unknowns[row], unknowns[column])
    except ValueError:
        return False
    np.add.at(matrix.values, position, -values[row, column])
    return True


def _slopes(wrench: Wrench, place: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Return the derivatives (9, 9) of the forces on p, f_1 and f_2 by p, f_1 and f_2."""
    start = np.concatenate([one, two])
    step = _SMALL * float(np.linalg.norm(one))
    slopes = np.zeros((9, 9))
    for column in range(6):
        part = step * np.eye(6)[column]
        ahead, behind = start + part, start - part
        change = wrench.pulls(place, ahead[:3], ahead[3:]) - wrench.pulls(place, behind[:3], behind[3:])
        slopes[:, 3 + column] = change.ravel() / (2.0 * step)
    return slopes
