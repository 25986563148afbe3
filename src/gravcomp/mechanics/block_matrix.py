"""Symmetric matrices of slender bodies: block tridiagonal storage and its Cholesky factorisation.

A breadth-first walk from the clamp orders the unknowns in levels; each level is coupled only with itself and with its neighbours
(Cuthill and McKee 1969). With A_ii = D_i and A_(i+1)i = B_i,

    L_i L_i^T = D_i - X_(i-1) X_(i-1)^T,      X_i = B_i L_i^-T.

Within a level, the unknowns without coupling to the next level (nodes in the middle of an element) come first: their columns of
B_i are zero and are not stored. The blocks are large enough for LAPACK to run at full speed; that makes this faster than band
storage here, above all for several right-hand sides.
"""

import dataclasses
import itertools
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numba import njit
from scipy.linalg.blas import dgemm, dgemv, dsymm, dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class NotPositiveDefinite(ArithmeticError):
    """The matrix has no Cholesky factor: the state is unstable or far from equilibrium."""


class Factor(Protocol):
    """Solves with a matrix A."""

    def solve(self, right: np.ndarray, /) -> np.ndarray:
        """Return A^-1 b for the right-hand sides b (n,) or (n, k)."""


@dataclasses.dataclass(frozen=True)
class BlockPattern:
    """Layout of the blocks. size (l,) of the levels; seen (l - 1,): size of each level's part that is coupled to the next one."""

    size: np.ndarray
    seen: np.ndarray

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return int(self.size.sum())

    @property
    def start(self) -> np.ndarray:
        """(l + 1,) first unknown of every level."""
        return np.concatenate([[0], np.cumsum(self.size)])

    @property
    def offsets(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Positions of the first entry of every D_i (l,) and of every B_i (l - 1,), and the number of entries."""
        coupling = np.append(self.size[1:] * self.seen, 0)
        ends = np.cumsum(self.size**2 + coupling)
        diagonal = ends - self.size**2 - coupling
        return diagonal, (diagonal + self.size**2)[:-1], int(ends[-1])

    def position(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return the positions of the entries (row, column) in the flat storage; the upper triangle gives the mirror image.

        Raises ValueError for an entry outside the pattern.
        """
        position = np.empty(np.shape(row), dtype=np.int64)
        _write_positions(np.ravel(row), np.ravel(column), self.layout, position.reshape(-1))
        if (position < 0).any():
            raise ValueError("an entry lies outside the block pattern")
        return position

    @property
    def layout(self) -> "Layout":
        """The pattern for compiled functions, see `entry_position`."""
        diagonal, coupling, _ = self.offsets
        level = np.repeat(np.arange(len(self.size)), self.size)
        return Layout(
            level, *(np.append(part, [0]).astype(np.int64) for part in (self.start, self.size, self.seen, diagonal, coupling))
        )


class Layout(NamedTuple):
    """A `BlockPattern` as arrays: the level of every unknown; per level the first unknown, size, seen and offsets."""

    level: np.ndarray
    start: np.ndarray
    size: np.ndarray
    seen: np.ndarray
    diagonal: np.ndarray
    coupling: np.ndarray


@njit(cache=True)
def entry_position(row: int, column: int, layout: Layout) -> int:
    """Return the position of an entry, or of its mirror image, in the flat storage; -1 outside the pattern."""
    if row < column:
        row, column = column, row
    high, low = layout.level[row], layout.level[column]
    r, c = row - layout.start[high], column - layout.start[low]
    if high == low:
        return layout.diagonal[low] + c * layout.size[low] + r
    c -= layout.size[low] - layout.seen[low]
    if high != low + 1 or c < 0:
        return -1
    return layout.coupling[low] + c * layout.size[high] + r


@njit(cache=True)
def _write_positions(row: np.ndarray, column: np.ndarray, layout: Layout, position: np.ndarray) -> None:
    """Write the positions of the entries (e,)."""
    for k in range(len(row)):
        position[k] = entry_position(row[k], column[k], layout)


class BlockMatrix:
    """Storage for one matrix of a pattern. Add to the flat array `values` at `pattern.position(...)`."""

    def __init__(self, pattern: BlockPattern):
        self.pattern = pattern
        diagonal, coupling, count = pattern.offsets
        self.values = np.zeros(count)
        self._diagonal = [self.values[o : o + s * s].reshape(s, s, order="F") for o, s in zip(diagonal, pattern.size)]
        self._coupling = [
            self.values[o : o + r * c].reshape(r, c, order="F") for o, r, c in zip(coupling, pattern.size[1:], pattern.seen)
        ]

    def add_diagonal(self, value: float) -> None:
        """Add value x identity."""
        for block in self._diagonal:
            block[np.diag_indices(len(block))] += value

    def mean_diagonal(self) -> float:
        """Return the mean of the diagonal entries."""
        return float(np.concatenate([block.diagonal() for block in self._diagonal]).mean())

    def factor(self) -> "BlockCholesky":
        """Factorise in place and return the factor; the values are overwritten. Raises NotPositiveDefinite."""
        corners: list[np.ndarray] = []
        for i, block in enumerate(self._diagonal):
            if i:
                below = self._coupling[i - 1]
                dtrsm(1.0, corners[-1], below, side=1, lower=1, trans_a=1, overwrite_b=1)
                dsyrk(-1.0, below, beta=1.0, c=block, lower=1, overwrite_c=1)
            _, info = dpotrf(block, lower=1, clean=0, overwrite_a=1)
            if info:
                raise NotPositiveDefinite(f"level {i + 1} of {len(self._diagonal)} of the stiffness is not positive definite")
            if i < len(self._coupling):
                hidden = len(block) - self._coupling[i].shape[1]
                corners.append(np.asfortranarray(block[hidden:, hidden:]))
        return BlockCholesky(self.pattern, self._diagonal, self._coupling)

    def multiply(self, x: np.ndarray) -> np.ndarray:
        """Return A x for x (n,) or (n, k). Only valid before `factor`."""
        x = np.asarray(x, dtype=float)
        columns = x.reshape(len(x), -1)
        result = np.zeros_like(columns)
        start = self.pattern.start
        for i, block in enumerate(self._diagonal):
            rows = slice(start[i], start[i + 1])
            result[rows] += dsymm(1.0, block, columns[rows], lower=1)
            if i < len(self._coupling):
                below = slice(start[i + 1], start[i + 2])
                seen = slice(start[i + 1] - self._coupling[i].shape[1], start[i + 1])
                result[below] += self._coupling[i] @ columns[seen]
                result[seen] += self._coupling[i].T @ columns[below]
        return result.reshape(x.shape)

    def sparse(self) -> "csr_array":
        """Return the whole matrix, both triangles, for many products. Only valid before `factor`."""
        from scipy.sparse import coo_array, csr_array

        start, rows, columns, values = self.pattern.start, [], [], []

        def add(block: np.ndarray, row: int, column: int) -> None:
            i, k = np.nonzero(block)
            rows.append(i + row)
            columns.append(k + column)
            values.append(block[i, k])

        for i, block in enumerate(self._diagonal):
            add(np.tril(block) + np.tril(block, -1).T, start[i], start[i])
            if i < len(self._coupling):
                below = self._coupling[i]
                add(below, start[i + 1], start[i + 1] - below.shape[1])
                add(below.T, start[i + 1] - below.shape[1], start[i + 1])
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return csr_array(coo_array(entries, shape=(self.pattern.n, self.pattern.n)))


class BlockCholesky:
    """The factor of a BlockMatrix. It uses the matrix's storage, so it is void as soon as the matrix is filled again."""

    def __init__(self, pattern: BlockPattern, diagonal: list[np.ndarray], coupling: list[np.ndarray]):
        self._start = pattern.start.tolist()
        self._diagonal = diagonal
        self._coupling = coupling

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Return A^-1 b for b (n,) or (n, k)."""
        b = np.asarray(b, dtype=float)
        if b.size == len(b):  # a single right-hand side in half the time
            return self._solve_one(b.ravel()).reshape(b.shape)
        if not b.size:  # LAPACK takes no empty arrays
            return b.copy()
        parts: list[np.ndarray] = []
        for i, block in enumerate(self._diagonal):
            part = np.array(b[self._start[i] : self._start[i + 1]], order="F")
            if i:
                below = self._coupling[i - 1]
                part = dgemm(-1.0, below, parts[-1][-below.shape[1] :], 1.0, part, overwrite_c=1)
            parts.append(dtrsm(1.0, block, part, lower=1, overwrite_b=1))
        for i in range(len(parts) - 1, -1, -1):
            if i < len(self._coupling):
                below = self._coupling[i]
                parts[i][-below.shape[1] :] -= dgemm(1.0, below, parts[i + 1], trans_a=1)
            parts[i] = dtrsm(1.0, self._diagonal[i], parts[i], lower=1, trans_a=1, overwrite_b=1)
        return np.concatenate(parts)

    def _solve_one(self, b: np.ndarray) -> np.ndarray:
        """Return A^-1 b for b (n,)."""
        x = np.array(b)
        parts = [x[low:high] for low, high in itertools.pairwise(self._start)]  # each is solved in place
        for i, block in enumerate(self._diagonal):
            if i:
                below = self._coupling[i - 1]
                dgemv(-1.0, below, parts[i - 1][-below.shape[1] :], 1.0, parts[i], overwrite_y=1)
            dtrsv(block, parts[i], lower=1, overwrite_x=1)
        for i in range(len(parts) - 1, -1, -1):
            if i < len(self._coupling):
                below = self._coupling[i]
                dgemv(-1.0, below, parts[i + 1], 1.0, parts[i][-below.shape[1] :], trans=1, overwrite_y=1)
            dtrsv(self._diagonal[i], parts[i], lower=1, trans=1, overwrite_x=1)
        return x


def order_in_levels(cliques: list[np.ndarray], n_nodes: int, clamped: np.ndarray) -> tuple[np.ndarray, BlockPattern]:
    """Order the nodes so that coupled nodes lie in the same level or in neighbouring levels.

    cliques: arrays (k, c) of k groups of coupled nodes (elements, pieces of cables); clamped (b,): nodes without unknowns.
    Returns the order (n_nodes,), the clamped nodes last, and the pattern of the unknowns, three per node. Raises ValueError for
    nodes that are not connected to the clamp.
    """
    from scipy.sparse import csr_matrix

    rows = np.concatenate([np.repeat(np.arange(len(c)) + o, c.shape[1]) for c, o in _numbered(cliques)])
    columns = np.concatenate([c.ravel() for c in cliques])
    incidence = csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(rows.max() + 1, n_nodes))
    level = np.full(n_nodes, -1)
    level[clamped] = 0
    front = np.zeros(n_nodes)
    front[clamped] = 1.0
    depth = 0
    while front.any():
        depth += 1
        reached = (incidence.T @ (incidence @ front > 0)) > 0
        new = reached & (level < 0)
        level[new] = depth
        front = new.astype(float)
    if (level < 0).any():
        raise ValueError(f"{(level < 0).sum()} nodes of the mesh are not connected to the base")
    depth -= 1
    seen = np.zeros(n_nodes, dtype=bool)
    for i in range(1, depth):
        seen |= ((incidence.T @ (incidence @ (level == i + 1).astype(float) > 0)) > 0) & (level == i)
    order = np.lexsort((np.arange(n_nodes), seen, np.where(level == 0, depth + 1, level)))
    size = np.array([(level == i).sum() for i in range(1, depth + 1)])
    seen_count = np.array([(seen & (level == i)).sum() for i in range(1, depth)], dtype=int)
    return order, BlockPattern(3 * size, 3 * seen_count)


def _numbered(cliques: list[np.ndarray]) -> list[tuple[np.ndarray, int]]:
    """Return each array of groups with the number of its first group."""
    first = np.concatenate([[0], np.cumsum([len(c) for c in cliques])])
    return list(zip(cliques, first))
