"""The loop's delay with the inner nodes in one process, compared with that as processes.

Runs of both kinds follow each other in pairs, so that the load of the machine is alike within a pair. Each pair gives one ratio;
their median counts, and the interval in which it is known: median +- 1.57 IQR / sqrt(n), which covers the true median with about
95 % (R. McGill, J. W. Tukey, W. A. Larsen, "Variations of Box Plots", The American Statistician 1978, 32(1), 12-16). Pairs are
added until the interval is narrow; where other programs move the delay more than the nodes do, there is no answer.
"""

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from gravcomp.evaluation.bus_delay import delays_during
from gravcomp.launcher.virtual_graph import RunningGraph

_FEWEST = 5  # pairs
# The ratio is known within so many percentage points on both sides, or so large a part of itself.
_NARROW, _CLEAR = 5.0, 0.2


class Ratio(NamedTuple):
    """By how much less (%) the second of each pair is, and the half width of the interval in which that is known."""

    less: float
    within: float

    @property
    def is_known(self) -> bool:
        """Whether the interval is narrow, in percentage points or against the ratio."""
        return self.within <= max(_NARROW, _CLEAR * self.less)


def ratio(apart: Sequence[float], together: Sequence[float]) -> Ratio:
    """Return the ratio of paired delays, in any unit. A single pair is known by nothing else: its interval is infinite."""
    less = 100.0 * (1.0 - np.asarray(together, dtype=float) / np.asarray(apart, dtype=float))
    low, high = np.percentile(less, [25, 75])
    within = 1.57 * (high - low) / np.sqrt(len(less)) if len(less) > 1 else np.inf
    return Ratio(float(np.median(less)), float(within))


def compare(progress: Callable[[str], None], *, pairs: int, listen: float, warm_up: float) -> dict:
    """Return `delay_ms` of the nodes as processes and, under `composed`, of the same in one process, and how much less it is.

    pairs: at most; listen, warm_up: of a run, in s. Raises TimeoutError when the pairs do not agree.
    """
    delays: dict[bool, list[list[float]]] = {False: [], True: []}
    found = Ratio(0.0, np.inf)
    for number in range(pairs):
        pair = {}
        for composed in (False, True) if number % 2 == 0 else (True, False):
            known = f", {found.less:.0f} +- {found.within:.0f} % less" if len(delays[True]) > 1 else ""
            progress(f"pair {number + 1} of at most {pairs}: {'one process' if composed else 'processes'}{known}")
            pair[composed] = _delays(composed, listen, warm_up)
        if not all(pair.values()):
            continue  # the machine did something else
        for composed, run in pair.items():
            delays[composed].append(run)
        medians = {kind: [float(np.median(run)) for run in runs] for kind, runs in delays.items()}
        found = ratio(medians[False], medians[True])
        if len(delays[True]) >= _FEWEST and found.is_known:
            break
    if not delays[True]:
        raise TimeoutError("no command was traced on the bus while listening")
    if pairs >= _FEWEST and not (found.is_known and len(delays[True]) >= _FEWEST):
        raise TimeoutError(
            f"after {len(delays[True])} of {pairs} pairs of runs the ratio is known to +- {found.within:.0f} % only"
            f" ({found.less:.0f} % less): other programs move the delay more than the nodes do; measure again when the machine"
            " does nothing else"
        )
    tails = {kind: [float(np.percentile(run, 99)) for run in runs] for kind, runs in delays.items()}
    apart, together = ({"median": medians[kind], "p99": tails[kind]} for kind in (False, True))
    return {
        "robot": "virtual robot",
        "delay_ms": _summary(apart, delays[False]),
        "composed": {
            "delay_ms": _summary(together, delays[True]),
            "less_pct": {
                "median": round(found.less, 1),
                "within": round(found.within, 1) if np.isfinite(found.within) else None,
                "p99": round(ratio(tails[False], tails[True]).less, 1),
            },
            "pairs": len(delays[True]),
            "commands_hz": round(min(len(run) for run in delays[True]) / listen, 1),
        },
    }


def _delays(composed: bool, listen: float, warm_up: float) -> list[float]:
    """Return the delays (ms) of one run; none where no command was traced."""
    with RunningGraph(composed=composed) as graph:
        graph.wait_for_commands()
        time.sleep(warm_up)
        found = delays_during(graph.can, listen)
        graph.check()
    return [1e3 * delay for delay in found]


def _summary(of_runs: dict[str, list[float]], delays: list[list[float]]) -> dict[str, float]:
    """Return the medians over the runs, and the number of delays."""
    return {**{key: round(float(np.median(values)), 2) for key, values in of_runs.items()}, "samples": sum(map(len, delays))}
