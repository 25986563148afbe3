"""A long run of the graph: no command must be lost, and no process must grow.

A command is lost when the controller published it and its CommandTrace did not appear on the bus, because the middleware
dropped it or the bridge refused it. Memory growth is the median resident set of the last tenth of the run minus that of the
first tenth after the warm-up.
"""

import statistics
import time
from collections.abc import Callable

from gravcomp.bench.current_monitor import CurrentMonitor
from gravcomp.bench.probe import Probe
from gravcomp.description import load_robot_file
from gravcomp.launcher.virtual_graph import NODES, START_TIMEOUT, RunningGraph

_WARM_UP = 60.0  # s, at most a fifth of the run
_SAMPLE = 2.0  # s between two samples of the memory
_SETTLE = 1.0  # s for the last commands to arrive


def run(progress: Callable[[str], None], *, minutes: float = 30.0) -> dict:
    """Return `lost_commands`, `memory_growth_mb` by process, `worst_growth_mb`, `limit_violations` and further figures."""
    limit = load_robot_file("article").hardware.drive.current_limit
    parameters: dict[str, dict] = {"virtual_robot": {"motion": "tremor"}, "inverse_controller": {"enabled": False}}
    with RunningGraph(parameters) as graph:
        progress("starting the graph")
        probe, monitor = Probe(graph), CurrentMonitor(graph, limit)
        try:
            _enable(probe)
            graph.wait_for_commands()
            memory = _watch(graph, 60.0 * minutes, progress)
            probe.enable(False)
            time.sleep(_SETTLE)
            commands, traces = probe.count()["commands"], monitor.traces
            graph.check()
        finally:
            probe.close()
            monitor.close()
    growth = {name: round(_growth(samples, 60.0 * minutes), 2) for name, samples in memory.items()}
    return {
        "robot": "virtual robot",
        "minutes": minutes,
        "commands": commands,
        "lost_commands": commands - traces,
        "memory_growth_mb": growth,
        "worst_growth_mb": max(growth.values()),
        "limit_violations": monitor.violations,
        "holds": len([seen for seen in probe.states if seen.state.name in ("HOLDING", "FAULT")]),
    }


def _enable(probe: Probe) -> None:
    """Enable the controller, and wait until it answers; on a new machine it compiles first."""
    end = time.monotonic() + START_TIMEOUT
    while True:
        try:
            return probe.enable(True)
        except TimeoutError:
            if time.monotonic() > end:
                raise


def _watch(graph: RunningGraph, duration: float, progress: Callable[[str], None]) -> dict[str, list[tuple[float, float]]]:
    """Return the memory of each process as (s, MB)."""
    processes = {name: graph.process(name) for name in NODES}
    samples: dict[str, list] = {name: [] for name in NODES}
    begin = time.monotonic()
    while (elapsed := time.monotonic() - begin) < duration:
        graph.check()
        for name, process in processes.items():
            samples[name].append((elapsed, process.memory_info().rss / 2**20))
        progress(f"{elapsed / 60:.1f} of {duration / 60:.1f} min")
        time.sleep(min(_SAMPLE, duration / 50))
    return samples


def _growth(samples: list[tuple[float, float]], duration: float) -> float:
    warm = min(_WARM_UP, 0.2 * duration)
    after = [memory for elapsed, memory in samples if elapsed >= warm]
    tenth = max(1, len(after) // 10)
    return statistics.median(after[-tenth:]) - statistics.median(after[:tenth])
