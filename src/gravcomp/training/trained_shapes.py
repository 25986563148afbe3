"""Trained shapes with their products by the stiffness at rest, which everything that is asked about modes needs."""

from dataclasses import dataclass

import numpy as np

from gravcomp.mechanics.block_matrix import BlockMatrix
from gravcomp.training.samples import Sample


@dataclass(frozen=True)
class TrainedShapes:
    """Displacements u of samples, rows (s, 3 n_free), and K_0 u in `weighted` (s, 3 n_free)."""

    rows: np.ndarray
    weighted: np.ndarray

    @staticmethod
    def of(some: list[Sample], stiffness: BlockMatrix) -> "TrainedShapes":
        """Return those of the samples. stiffness: K_0."""
        rows = np.array([sample.unknowns for sample in some])
        return TrainedShapes(rows, np.ascontiguousarray(stiffness.multiply(rows.T).T))

    def part(self, which: slice | np.ndarray) -> "TrainedShapes":
        """Return some of the shapes."""
        return TrainedShapes(self.rows[which], self.weighted[which])

    def gram(self) -> np.ndarray:
        """Return their products (s, s) in the energy at rest."""
        return self.rows @ self.weighted.T

    def coordinates(self, basis: np.ndarray) -> np.ndarray:
        """Return their coordinates (s, r) in a basis (3 n_free, r) that is orthonormal in the energy at rest."""
        return self.weighted @ basis

    def missing(self, basis: np.ndarray) -> np.ndarray:
        """Return what such a basis does not represent of each (s, 3 n_free)."""
        return self.rows - self.coordinates(basis) @ basis.T


def evenly(count: int, most: int) -> np.ndarray:
    """Return at most `most` of the numbers below `count`, evenly spaced."""
    return np.linspace(0, count - 1, min(most, count)).astype(int)
