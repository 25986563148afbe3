"""All checks over a stream, sample by sample; NumPy looks at a block at once, so that a sample costs microseconds."""

import math
from collections.abc import Sequence

import numpy as np

from gravcomp.stream_checks.axes import Axes
from gravcomp.stream_checks.finding import Block, Check, Finding
from gravcomp.stream_checks.resting import Resting
from gravcomp.stream_checks.spikes import Spikes
from gravcomp.stream_checks.timing import Timing
from gravcomp.stream_checks.values import Values

BLOCK = 256  # samples at least
_LEAST = 0.6  # s of a block: longer than a window in which a sensor rests

_LARGEST = 1e12  # in any unit: a larger value is no measurement, and its square may overflow
_HIDES = {
    "gyro_unit": ("gyro_quantised", "gyro_stuck"),
    "accel_unit": ("accel_quantised", "accel_stuck", "accel_clipped"),
    "gyro_quantised": ("gyro_spikes",),
    "accel_quantised": ("accel_spikes",),
}
"""Kinds that follow from another one: steps between values are known in SI only, and coarse steps look like spikes."""


def block_length(rate: float) -> int:
    """Return the samples of a block of a stream with a rate in Hz."""
    return max(BLOCK, math.ceil(_LEAST * rate))


class StreamMonitor:
    """Takes samples as recorded; `findings` is what is odd so far."""

    def __init__(self, memory: float = math.inf):
        """memory: time constant in s with which a live stream forgets; infinite: every sample counts alike."""
        self._memory = memory
        self.reset()

    def reset(self) -> None:
        """Start with a new stream."""
        self._stamps: list[int] = []
        self._gyro: list[Sequence[float]] = []
        self._accel: list[Sequence[float]] = []
        self._last_ns: int | None = None
        self._period = 0.0
        self._block = BLOCK
        self._resting = Resting()
        self._axes = Axes()
        self._checks: tuple[Check, ...] = (self._axes, self._resting, Spikes(), Values("gyro"), Values("accel"), Timing())
        self._current: list[Finding] | None = None
        self._unknown: list[str] | None = None

    @property
    def starts_upside_down(self) -> bool:
        """Whether the first rest is upside down."""
        return self._resting.starts_upside_down

    def add(self, stamp_ns: int, gyro: Sequence[float], accel: Sequence[float]) -> None:
        """Take a sample: stamp in ns, rate (3,) and specific force (3,)."""
        self._stamps.append(stamp_ns)
        self._gyro.append(gyro)
        self._accel.append(accel)
        if len(self._stamps) >= self._block:
            self.add_block(np.array(self._stamps), np.array(self._gyro), np.array(self._accel))
            self._stamps, self._gyro, self._accel = [], [], []

    def add_block(self, stamp_ns: np.ndarray, gyro: np.ndarray, accel: np.ndarray) -> None:
        """Take n samples: stamps (n,) in ns, rates (n, 3) and specific forces (n, 3)."""
        finite = (np.abs(gyro) < _LARGEST).all(axis=1) & (np.abs(accel) < _LARGEST).all(axis=1)
        stamp_ns, gyro, accel = stamp_ns[finite], gyro[finite], accel[finite]
        if len(stamp_ns) < 8:
            return
        before = [] if self._last_ns is None else [self._last_ns]
        steps = np.diff(np.concatenate([np.array(before, np.int64), stamp_ns])) * 1e-9
        self._last_ns = int(stamp_ns[-1])
        forward = steps[steps > 0.0]
        if len(forward):
            self._period = float(np.median(forward))
        if not self._period:
            return
        self._block = block_length(1.0 / self._period)
        block = Block(stamp_ns, gyro, accel, self._period, steps)
        keep = math.exp(-len(stamp_ns) * self._period / self._memory)
        for check in self._checks:
            if keep < 1.0:
                check.forget(keep)
            check.take(block)
        self._current = self._unknown = None

    def findings(self) -> list[Finding]:
        """Return what is odd, the worst first."""
        if self._current is None:
            found = [finding for check in self._checks for finding in check.findings()]
            hidden = {kind for finding in found for kind in _HIDES.get(finding.kind, ())}
            # Of two looks at the length of gravity the later one, at rest, counts.
            kinds = {finding.kind: finding for finding in found if finding.kind not in hidden}
            self._current = sorted(kinds.values(), key=lambda finding: not finding.fatal)
        return self._current

    def unknown(self) -> list[str]:
        """Return what the stream does not show, a sentence each."""
        if self._unknown is None:
            self._unknown = [] if any(finding.fatal for finding in self.findings()) else self._axes.unknown()
        return self._unknown
