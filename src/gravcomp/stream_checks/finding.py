"""One odd thing of a stream, and a block of samples in which it is looked for."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class Finding:
    """`kind`: a key; `text`: a sentence for the user; `fatal`: the unit is wrong, nothing can be computed.

    A finding with a `gyro_matrix` or an `accel_factor` can be converted: rate (rad/s) = gyro_matrix rate as recorded,
    specific force (m/s^2) = accel_factor times the one recorded.
    """

    kind: str
    text: str
    fatal: bool = False
    gyro_matrix: np.ndarray | None = None
    accel_factor: float | None = None

    @property
    def convertible(self) -> bool:
        """Whether the finding says how to convert the stream."""
        return self.gyro_matrix is not None or self.accel_factor is not None


@dataclass(frozen=True)
class Block:
    """n samples in the order of reception, all finite; the first follows the last one of the block before."""

    stamp_ns: np.ndarray  # (n,) int64
    gyro: np.ndarray  # (n, 3), as recorded
    accel: np.ndarray  # (n, 3), as recorded
    period: float  # s, median step
    steps: np.ndarray  # (n or n - 1,) s, from the sample before


class Check(Protocol):
    """One kind of check over the blocks of a stream."""

    def forget(self, keep: float) -> None:
        """Let what was seen so far count only `keep` (0 to 1) times as much."""

    def take(self, block: Block) -> None:
        """Look at a block."""

    def findings(self) -> list[Finding]:
        """Return what is odd so far."""
        ...
