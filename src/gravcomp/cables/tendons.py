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
        self._together, self._group = _groups(pieces)
        self._place = _places(self._together[self._group[:-1]], self._first, self._nodes, self._n_free, pattern.layout)
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
            self._cable, self._first, self._weights, state.tangent, state.length, state.share, tension, self._together,
            self._group, self._place, matrix.values,
        )  # fmt: skip


def pieces_of(route: Route) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return nodes and weights d of every piece e_k between neighbouring points."""
    shares: list[dict[int, float]] = []  # of the points in each piece
    for k in range(len(route.smooth) - 1):
        share = {k: -1.0, k + 1: 1.0}
        for middle, sign in ((k + 1, -1.0), (k, 1.0)):
            if route.smooth[middle]:
                for point, factor in ((middle - 1, 1.0), (middle, -2.0), (middle + 1, 1.0)):
                    share[point] = share.get(point, 0.0) + sign * factor * _BEYOND_CHORD
        shares.append(share)
    points = np.array([point for share in shares for point in share], dtype=np.int64)
    factors = np.array([factor for share in shares for factor in share.values()])
    nodes, signed = route.points.nodes[points], factors[:, None] * route.points.weights[points]
    # Piece and node as one number: the nodes of all pieces are sorted at once.
    count = int(route.points.nodes.max(initial=0)) + 1
    piece = np.repeat(np.arange(len(shares)), [len(share) for share in shares])
    unique, inverse = np.unique(piece[:, None] * count + nodes, return_inverse=True)
    weights = np.bincount(inverse.ravel(), signed.ravel())
    unique, weights = unique[weights != 0.0], weights[weights != 0.0]
    ends = np.searchsorted(unique, count * np.arange(1, len(shares)))
    return list(zip(np.split(unique % count, ends), np.split(weights, ends)))


def _groups(pieces: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces (s,) sorted into groups that hang on the same nodes, and where each group begins (g + 1,).

    Cables that move with the same sections do so: their stiffnesses are added up before they are added to the matrix.
    """
    groups: dict[bytes, list[int]] = {}
    for k, (nodes, _) in enumerate(pieces):
        groups.setdefault(nodes.tobytes(), []).append(k)
    members = [k for group in groups.values() for k in group]
    return np.array(members, dtype=np.int64), np.cumsum([0, *map(len, groups.values())]).astype(np.int64)


@njit(cache=True)
def _places(piece: np.ndarray, first: np.ndarray, nodes: np.ndarray, n_free: int, layout: Layout) -> np.ndarray:
    """Return where (p, 2) the 3 x 3 blocks of each pair of nodes a >= b of the pieces (g,) are.

    The position of a block's first entry, -1 if a node is clamped, and the distance between its columns; the entries of a column
    lie one after the other, as the nodes of a piece are sorted.
    """
    count = 0
    for k in piece:
        size = first[k + 1] - first[k]
        count += size * (size + 1) // 2
    place = np.full((count, 2), -1, dtype=np.int64)
    pair = 0
    for k in piece:
        for a in range(first[k], first[k + 1]):
            for b in range(first[k], a + 1):
                if nodes[a] < n_free and nodes[b] < n_free:
                    place[pair, 0] = entry_position(3 * nodes[a], 3 * nodes[b], layout)
                    place[pair, 1] = layout.size[layout.level[3 * nodes[a]]]
                pair += 1
    return place


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
    tension: np.ndarray, together: np.ndarray, group: np.ndarray, place: np.ndarray, values: np.ndarray,
) -> None:  # fmt: skip
    """Add the geometric stiffness of all pieces to `values`, group by group at its `place`."""
    pair = 0
    start, stiffness, scaled = np.empty(len(cable), np.int64), np.empty((len(cable), 6)), np.empty((len(cable), 6))
    for g in range(len(group) - 1):
        members, size = 0, 0
        for k in together[group[g] : group[g + 1]]:
            size = first[k + 1] - first[k]
            factor = tension[cable[k]] * share[k] / length[k]
            if factor == 0.0:
                continue
            x, y, z = tangent[k]
            start[members], of = first[k], stiffness[members]
            of[0], of[1], of[2] = factor * (1.0 - x * x), factor * (1.0 - y * y), factor * (1.0 - z * z)
            of[3], of[4], of[5] = -factor * x * y, -factor * x * z, -factor * y * z
            members += 1
        if members == 0:
            pair += size * (size + 1) // 2
            continue
        for a in range(size):
            for k in range(members):
                for i in range(6):
                    scaled[k, i] = weights[start[k] + a] * stiffness[k, i]
            for b in range(a + 1):
                at, column = place[pair]
                pair += 1
                if at < 0:
                    continue
                xx = yy = zz = xy = xz = yz = 0.0
                for k in range(members):
                    w = weights[start[k] + b]
                    xx += w * scaled[k, 0]
                    yy += w * scaled[k, 1]
                    zz += w * scaled[k, 2]
                    xy += w * scaled[k, 3]
                    xz += w * scaled[k, 4]
                    yz += w * scaled[k, 5]
                values[at] += xx
                values[at + 1] += xy
                values[at + 2] += xz
                values[at + column + 1] += yy
                values[at + column + 2] += yz
                values[at + 2 * column + 2] += zz
                if b < a:
                    values[at + column] += xy
                    values[at + 2 * column] += xz
                    values[at + 2 * column + 1] += yz
