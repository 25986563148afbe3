"""The cables in reduced coordinates: their straight pieces e_k(q) = e_k(0) + D_k q, and what follows from them, compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.linalg.blas import dsyrk

from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.simulation.statics import CableInput

_REORDERED = {"reassoc", "contract", "nsz", "arcp"}


class ReducedTendons(NamedTuple):
    """The cables at coordinates q: tangent (s, 3) and length (s,) of the pieces, displacement (m,) of the paths and its
    derivative jacobian (m, r)."""

    tangent: np.ndarray
    length: np.ndarray
    displacement: np.ndarray
    jacobian: np.ndarray


class ReducedCables:
    """The cables of a reduced model."""

    def __init__(self, model: ReducedModel):
        self._model = model
        self._flat_change = model.piece_change.reshape(-1, model.size)

    def state(self, q: np.ndarray) -> ReducedTendons:
        """The cables at q (r,)."""
        model = self._model
        pieces = model.piece_rest + (self._flat_change @ q).reshape(-1, 3)
        tangent, length, path, jacobian = _paths(pieces, model.piece_cable, model.piece_change, len(model.rest_length))
        return ReducedTendons(tangent, length, model.rest_length - path, jacobian)

    def stiffness_added(
        self, matrix: np.ndarray, tendons: ReducedTendons, tension: np.ndarray, factor: float = 1.0
    ) -> np.ndarray:
        """The symmetric matrix (r, r), column-major and overwritten, with `factor` times the stiffness that the tensions
        (m,) give the body in its lower triangle."""
        if not tension.any():
            return matrix
        rows = _taut_rows(tendons.tangent, tendons.length, self._model.piece_cable, self._model.piece_change, factor * tension)
        return dsyrk(1.0, rows.T, beta=1.0, c=matrix, lower=1, overwrite_c=1)

    def lacking(self, tendons: ReducedTendons, tension: np.ndarray, compliance: np.ndarray, cables: CableInput) -> np.ndarray:
        """Change of tension (m,) that would about bring the cables to the displacements they are wound to; none where they
        are slack. compliance (m, m)."""
        if cables.wound is None:
            return np.zeros_like(tension)
        gap = cables.wound - tendons.displacement - self._model.axial_compliance * tension
        pulled = (tension > 0.0) | (gap > 0.0)  # a released cable's gap is NaN: neither
        return np.where(pulled, gap, 0.0) / compliance.diagonal()


@njit(cache=True, fastmath=_REORDERED)
def _paths(pieces, cable, change, count):
    """Tangent (s, 3) and length (s,) of the pieces, path (m,) and Jacobian (m, r) of the cables' displacement."""
    r = change.shape[2]
    tangent, length = np.empty(pieces.shape), np.empty(len(pieces))
    path, jacobian = np.zeros(count), np.zeros((count, r))
    for k in range(len(pieces)):
        x, y, z = pieces[k, 0], pieces[k, 1], pieces[k, 2]
        length[k] = np.sqrt(x * x + y * y + z * z)
        path[cable[k]] += length[k]
        x, y, z = x / length[k], y / length[k], z / length[k]
        tangent[k, 0], tangent[k, 1], tangent[k, 2] = x, y, z
        row, along_x, along_y, along_z = jacobian[cable[k]], change[k, 0], change[k, 1], change[k, 2]
        for a in range(r):
            row[a] -= x * along_x[a] + y * along_y[a] + z * along_z[a]
    return tangent, length, path, jacobian


@njit(cache=True, fastmath=_REORDERED)
def _taut_rows(tangent, length, cable, change, tension):
    """sqrt(tension / length) (I - t t^T) D of every taut piece, (3 k, r): the stiffness is the product of the rows with themselves."""
    r = change.shape[2]
    rows = np.empty((3 * len(length), r))
    used = 0
    for k in range(len(length)):
        root = np.sqrt(tension[cable[k]] / length[k])
        if root == 0.0:
            continue
        x, y, z = tangent[k, 0], tangent[k, 1], tangent[k, 2]
        of_x, of_y, of_z = change[k, 0], change[k, 1], change[k, 2]
        to_x, to_y, to_z = rows[used], rows[used + 1], rows[used + 2]
        for a in range(r):
            along = x * of_x[a] + y * of_y[a] + z * of_z[a]
            to_x[a] = root * (of_x[a] - x * along)
            to_y[a] = root * (of_y[a] - y * along)
            to_z[a] = root * (of_z[a] - z * along)
        used += 3
    return rows[:used]
