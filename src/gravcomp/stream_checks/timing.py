"""Stamps: repeated, older than the one before, missing samples, jitter."""

import numpy as np

from gravcomp.stream_checks.finding import Block, Finding

MISSING = 2.5  # periods: samples are missing in a longer step
JITTER = 0.1  # RMS of the steps, of the period
FEW = 0.002  # share of the samples below which a repeated or old stamp is no property of the stream


class Timing:
    """Counts of the steps between stamps."""

    def __init__(self) -> None:
        self._count = self._repeated = self._older = self._gaps = self._square = self._even = 0.0
        self._longest = 0.0

    def forget(self, keep: float) -> None:
        """Multiply all counts by `keep`."""
        for name in ("_count", "_repeated", "_older", "_gaps", "_square", "_even"):
            setattr(self, name, keep * getattr(self, name))

    def take(self, block: Block) -> None:
        """Count the steps of a block."""
        steps = block.steps
        self._count += len(steps)
        self._repeated += np.count_nonzero(steps == 0)
        back = steps < 0
        self._older += np.count_nonzero(back)
        # Of samples in the wrong order the steps to both sides are neither jitter nor gaps.
        around = back.copy()
        around[1:] |= back[:-1]
        around[:-1] |= back[1:]
        steps = steps[~around]
        gaps = steps[steps > MISSING * block.period]
        self._gaps += len(gaps)
        self._longest = max(self._longest, float(gaps.max()) if len(gaps) else 0.0)
        even = steps[(steps > 0) & (steps <= MISSING * block.period)]
        self._square += float(np.sum((even / block.period - 1.0) ** 2))
        self._even += len(even)

    def findings(self) -> list[Finding]:
        """Return what is odd."""
        found = []
        if self._repeated > FEW * self._count:
            found.append(
                Finding("duplicates", f"{100 * self._repeated / self._count:.1f} % of the stamps repeat the one before: left out")
            )
        if self._older > 0.5:
            found.append(Finding("time_back", f"the time goes back {self._older:.0f} time(s): those samples are left out"))
        if self._gaps > 0.5:
            found.append(Finding("gaps", f"samples are missing {self._gaps:.0f} time(s), up to {self._longest:.2f} s"))
        jitter = (self._square / max(self._even, 1.0)) ** 0.5
        if jitter > JITTER:
            found.append(Finding("jitter", f"the stamps jitter by {100 * jitter:.0f} % of the period, RMS"))
        return found
