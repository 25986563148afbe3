"""The running graph: delay from IMU frame to current frame, CPU load and memory of each process.

The delay is measured on the bus (see gravcomp.evaluation.bus_delay), from the last frame of an IMU sample to the first current
frame that it caused, through bridge, estimator, simulator and controller, with six motors at 500 Hz feedback.
"""

import time
from collections.abc import Callable

import numpy as np

from gravcomp.bench import composition
from gravcomp.canbus import codec
from gravcomp.canbus.link import CanLink
from gravcomp.evaluation.bus_delay import delays_during
from gravcomp.launcher.virtual_graph import NODES, RunningGraph

_WARM_UP, _LISTEN, _COST = 5.0, 10.0, 15.0  # s
_PAIR_LISTEN, _PAIR_WARM_UP, _PAIRS = 4.0, 2.0, 10  # s, s; at most so many pairs of runs that are compared
_LIGHT = {"virtual_robot": {"feedback_rate": 125}}  # as in the demo


def run(
    progress: Callable[[str], None],
    *,
    composed: bool = False,
    listen: float | None = None,
    cost: float = _COST,
    warm_up: float | None = None,
    pairs: int = _PAIRS,
) -> dict:
    """Return `delay_ms` {median, p99, samples}, `bridge_cpu`, `cpu` and `memory_mb` by process, and `two_robots_hz`.

    CPU loads are shares of a core; `two_robots_hz`: followed commands per second of each of two robots that run at the same time.
    composed: return instead `delay_ms` and, under `composed`, that with the inner nodes in one process, and how much less it is
    (gravcomp.bench.composition). listen, cost: durations (s) of the measurements; warm_up: time (s) before them; pairs: at most.
    """
    if composed:
        return composition.compare(
            progress, pairs=pairs, listen=listen or _PAIR_LISTEN, warm_up=_PAIR_WARM_UP if warm_up is None else warm_up
        )
    listen, warm_up = listen or _LISTEN, _WARM_UP if warm_up is None else warm_up
    with RunningGraph() as graph:
        progress("starting the graph")
        graph.wait_for_commands()
        time.sleep(warm_up)
        progress(f"CPU load over {cost:.0f} s")
        shares = _shares(graph, cost)
        progress(f"delays over {listen:.0f} s")
        delays = 1e3 * np.array(delays_during(graph.can, listen))
        graph.check()
        memory = {name: graph.process(name).memory_info().rss / 2**20 for name in NODES}
    progress("two robots")
    rates = _two_robots(listen, warm_up)
    return {
        "robot": "virtual robot",
        "delay_ms": _summary(delays),
        "bridge_cpu": shares["can_bridge"],
        "cpu": shares,
        "memory_mb": {name: round(value, 1) for name, value in memory.items()},
        "two_robots_hz": {"slower": min(rates), "faster": max(rates)},
    }


def _summary(delays: np.ndarray) -> dict[str, float]:
    """Return median and 99th percentile of delays (ms), and their number. Raises TimeoutError for none."""
    if len(delays) == 0:
        raise TimeoutError("no command was traced on the bus while listening")
    median, p99 = float(np.median(delays)), float(np.percentile(delays, 99))
    return {"median": round(median, 2), "p99": round(p99, 2), "samples": len(delays)}


def _shares(graph: RunningGraph, duration: float) -> dict[str, float]:
    processes = {name: graph.process(name) for name in NODES}
    before, begin = {name: sum(p.cpu_times()[:2]) for name, p in processes.items()}, time.monotonic()
    time.sleep(duration)
    elapsed = time.monotonic() - begin
    return {name: round((sum(p.cpu_times()[:2]) - before[name]) / elapsed, 3) for name, p in processes.items()}


def _two_robots(duration: float, warm_up: float) -> list[float]:
    """Return the followed commands per second of two robots at the same time, each with its own namespace and bus."""
    with RunningGraph(_LIGHT) as left, RunningGraph(_LIGHT) as right:
        graphs = (left, right)
        for graph in graphs:
            graph.wait_for_commands()
        time.sleep(warm_up)
        links = [CanLink(graph.can, [codec.layout("CommandTrace").frame_id]) for graph in graphs]
        for link in links:
            link.open()
        counts, begin = [0, 0], time.monotonic()
        while (elapsed := time.monotonic() - begin) < duration:
            time.sleep(0.5)
            counts = [count + len(link.receive(0.0)) for count, link in zip(counts, links)]
        for graph, link in zip(graphs, links):
            graph.check()
            link.close()
    return [round(count / elapsed, 2) for count in counts]
