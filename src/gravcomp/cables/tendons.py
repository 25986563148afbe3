"""Sliding tendons through via points: length, its exact Jacobian, and the geometric stiffness under tension.

A cable runs straight between its via points P_k = sum_a w_ka x_a. With e_k = P_(k+1) - P_k = sum_a d_ka x_a, l_k = |e_k| and
t_k = e_k / l_k, its displacement (positive: pulled in), its force and its stiffness are

    delta = sum_k (L_k - l_k),    H_a = d(delta)/dx_a = -sum_k d_ka t_k,    force = H^T lambda,
    K_ab  = lambda sum_k d_ka d_kb (I - t_k t_k^T) / l_k.

Through the middle P_m of an element, from its end P_0 to P_1, a cable follows the parabola through the three points instead. Its
length is that of two tangents, by Gauss's rule with two points, which take the place of the two chords:

    e = (P_1 - P_0) / 2 -+ (P_0 - 2 P_m + P_1) / sqrt(3).

lambda is the tension at the capstan. With friction it changes along the path: lambda_k is the share of `friction` times lambda. A
line of stiffness E A is wound in by more than its path shortens, by its stretch along free length L_f and path:

    wound = delta + c lambda,    c = (L_f + sum_k L_k) / (E A) times the mean share.

Without tension there is no stretch.
"""

import dataclasses
import math

import numpy as np
from numba import njit

from gravcomp.cables.friction import Friction
from gravcomp.cables.routing import Route
from gravcomp.description import Cable
from gravcomp.mechanics.block_matrix import BlockMatrix, BlockPattern, Layout, entry_position

# What a tangent at one of Gauss's points has of the second difference of three points, beyond a chord.
_BEYOND_CHORD = 1.0 / math.sqrt(3.0) - 0.5


@dataclasses.dataclass(frozen=True)
class TendonState:
    """The cables at one shape.

    displacement (m,) in m; jacobian (m, n): its derivative by the unknowns; force_jacobian (m, n): its transpose times the
    tensions is the cables' force (without friction it is the same array); tangent (s, 3) and length (s,) of every piece; share
    (s,): tension in the piece over that at the capstan; mean_share (m,): mean of it along each cable, which stretches it.
    """

    displacement: np.ndarray
    jacobian: np.ndarray
    force_jacobian: np.ndarray
    tangent: np.ndarray
    length: np.ndarray
    share: np.ndarray
    mean_share: np.ndarray


class Tendons:
    """The cables of a robot on a mesh whose nodes are in the pattern's order."""

    def __init__(self, cables: tuple[Cable, ...], routes: list[Route], rest: np.ndarray, pattern: BlockPattern):
        self.count = len(cables)
        self.friction = Friction(cables)
        self._n_free = pattern.n // 3
        pieces = [piece for route in routes for piece in pieces_of(route)]
        self._cable = np.repeat(np.arange(self.count), [len(r.smooth) - 1 for r in routes]).astype(np.int64)
        self._first = np.concatenate([[0], np.cumsum([len(nodes) for nodes, _ in pieces])]).astype(np.int64)
        self._nodes = np.concatenate([nodes for nodes, _ in pieces]) if pieces else np.zeros(0, dtype=np.int64)
        self._weights = np.concatenate([weights for _, weights in pieces]) if pieces else np.zeros(0)
        self._position = _scatter_positions(self._first, self._nodes, self._n_free, pattern.layout)
        self._rest_length = np.zeros(self.count)
        self._rest_length = -self.state(rest).displacement
        # m/N: elongation from capstan to end under unit tension without friction, zero for a cable without stretch.
        self.axial_compliance = (self.friction.free_length + self._rest_length) / np.array([c.stiffness for c in cables])

    def stretch(self, state: TendonState) -> np.ndarray:
        """Return the elongation (m,) of each cable under unit tension at its capstan, in m/N."""
        return self.axial_compliance * state.mean_share

    @property
    def rest_length(self) -> np.ndarray:
        """(m,) path lengths on the straight robot, in m."""
        return self._rest_length

    def state(self, x: np.ndarray, pulling: np.ndarray | None = None) -> TendonState:
        """Return the cables at node positions x (n, 3).

        pulling (m,): 1 for a cable that is pulled in, -1 for one that is paid out, 0 for no friction.
        """
        count = len(self._cable)
        length, tangent = np.empty(count), np.empty((count, 3))
        jacobian = np.zeros((self.count, 3 * self._n_free))
        path = np.zeros(self.count)
        _tendons(x, self._cable, self._first, self._nodes, self._weights, self._n_free, length, tangent, jacobian, path)
        share, mean_share, force_jacobian = np.ones(count), np.ones(self.count), jacobian
        if pulling is not None and self.friction.acts(pulling):
            share = self.friction.shares(self._cable, tangent, pulling)
            mean_share = self.friction.mean_shares(self._cable, length, share, pulling)
            force_jacobian = np.zeros_like(jacobian)
            _force_jacobian(self._cable, self._first, self._nodes, self._weights, self._n_free, tangent, share, force_jacobian)
        return TendonState(self._rest_length - path, jacobian, force_jacobian, tangent, length, share, mean_share)

    def add_stiffness(self, state: TendonState, tension: np.ndarray, matrix: BlockMatrix) -> None:
        """Add the geometric stiffness of the cables under `tension` (m,) to `matrix`."""
        _add_stiffness(
            self._cable, self._first, self._weights, state.tangent, state.length, state.share, tension, self._position,
            matrix.values,
        )  # fmt: skip


def pieces_of(route: Route) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return nodes and weights d of every piece e_k between neighbouring points."""
    pieces = []
    for k in range(len(route.smooth) - 1):
        share = {k: -1.0, k + 1: 1.0}
        for middle, sign in ((k + 1, -1.0), (k, 1.0)):
            if route.smooth[middle]:
                for point, factor in ((middle - 1, 1.0), (middle, -2.0), (middle + 1, 1.0)):
                    share[point] = share.get(point, 0.0) + sign * factor * _BEYOND_CHORD
        nodes = np.concatenate([route.points.nodes[point] for point in share])
        signed = np.concatenate([factor * route.points.weights[point] for point, factor in share.items()])
        unique, inverse = np.unique(nodes, return_inverse=True)
        weights = np.bincount(inverse, signed)
        used = weights != 0.0
        pieces.append((unique[used], weights[used]))
    return pieces


@njit(cache=True)
def _scatter_positions(first: np.ndarray, nodes: np.ndarray, n_free: int, layout: Layout) -> np.ndarray:
    """Return the positions of the 3 x 3 entries of each pair of nodes a >= b of each piece; -1 if clamped or mirrored."""
    count = 0
    for k in range(len(first) - 1):
        size = first[k + 1] - first[k]
        count += 9 * (size * (size + 1) // 2)
    position = np.full(count, -1, dtype=np.int64)
    entry = 0
    for k in range(len(first) - 1):
        for a in range(first[k], first[k + 1]):
            for b in range(first[k], a + 1):
                if nodes[a] < n_free and nodes[b] < n_free:
                    for i in range(3):
                        for j in range(3 if b < a else i + 1):
                            position[entry + 3 * i + j] = entry_position(3 * nodes[a] + i, 3 * nodes[b] + j, layout)
                entry += 9
    return position


@njit(cache=True)
def _tendons(
    x: np.ndarray, cable: np.ndarray, first: np.ndarray, nodes: np.ndarray, weights: np.ndarray, n_free: int, length: np.ndarray,
    tangent: np.ndarray, jacobian: np.ndarray, path: np.ndarray,
) -> None:  # fmt: skip
    """Write length and tangent of every piece and add them to the Jacobian and the path lengths of the cables."""
    e = np.empty(3)
    for k in range(len(cable)):
        e[:] = 0.0
        for q in range(first[k], first[k + 1]):
            for i in range(3):
                e[i] += weights[q] * x[nodes[q], i]
        length[k] = np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
        path[cable[k]] += length[k]
        for i in range(3):
            tangent[k, i] = e[i] / length[k]
        for q in range(first[k], first[k + 1]):
            if nodes[q] < n_free:
                for i in range(3):
                    jacobian[cable[k], 3 * nodes[q] + i] -= weights[q] * tangent[k, i]


@njit(cache=True)
def _force_jacobian(
    cable: np.ndarray, first: np.ndarray, nodes: np.ndarray, weights: np.ndarray, n_free: int, tangent: np.ndarray,
    share: np.ndarray, jacobian: np.ndarray,
) -> None:  # fmt: skip
    """Add the forces of unit tensions, with friction, to `jacobian` (m, n)."""
    for k in range(len(cable)):
        for q in range(first[k], first[k + 1]):
            if nodes[q] < n_free:
                for i in range(3):
                    jacobian[cable[k], 3 * nodes[q] + i] -= share[k] * weights[q] * tangent[k, i]


@njit(cache=True)
def _add_stiffness(
    cable: np.ndarray, first: np.ndarray, weights: np.ndarray, tangent: np.ndarray, length: np.ndarray, share: np.ndarray,
    tension: np.ndarray, position: np.ndarray, values: np.ndarray,
) -> None:  # fmt: skip
    """Add the geometric stiffness of all pieces to `values` at `position`."""
    block = np.empty((3, 3))
    entry = 0
    for k in range(len(cable)):
        factor = tension[cable[k]] * share[k] / length[k]
        if factor == 0.0:
            size = first[k + 1] - first[k]
            entry += 9 * (size * (size + 1) // 2)
            continue
        for i in range(3):
            for j in range(3):
                block[i, j] = factor * ((1.0 if i == j else 0.0) - tangent[k, i] * tangent[k, j])
        for a in range(first[k], first[k + 1]):
            for b in range(first[k], a + 1):
                pair = weights[a] * weights[b]
                for i in range(3):
                    for j in range(3):
                        if position[entry] >= 0:
                            values[position[entry]] += pair * block[i, j]
                        entry += 1
