"""The running graph: delay from IMU frame to current frame, CPU load and memory of each process.

The delay is measured on the bus (see gravcomp.evaluation.bus_delay), from the last frame of an IMU sample to the first current
frame that it caused, through bridge, estimator, simulator and controller, with six motors at 500 Hz feedback.
"""

import time
from collections.abc import Callable

import numpy as np

from gravcomp.canbus import c610, codec
from gravcomp.canbus.link import CanLink
from gravcomp.evaluation.bus_delay import delays_of
from gravcomp.launcher.virtual_graph import NODES, RunningGraph

_WARM_UP, _LISTEN, _COST = 5.0, 10.0, 15.0  # s
_TURNS = 2  # of each of two kinds that are compared
_LIGHT = {"virtual_robot": {"feedback_rate": 125}}  # as in the demo


def run(
    progress: Callable[[str], None],
    *,
    composed: bool = False,
    listen: float = _LISTEN,
    cost: float = _COST,
    warm_up: float = _WARM_UP,
) -> dict:
    """Return `delay_ms` {median, p99, samples}, `bridge_cpu`, `cpu` and `memory_mb` by process, and `two_robots_hz`.

    CPU loads are shares of a core; `two_robots_hz`: followed commands per second of each of two robots that run at the same time.
    composed: return instead `delay_ms` and, under `composed`, that with the inner nodes in one process, and how much less it is.
    listen, cost: durations (s) of the measurements; warm_up: time (s) before them.
    """
    if composed:
        return _compare(progress, listen, warm_up)
    with RunningGraph() as graph:
        progress("starting the graph")
        graph.wait_for_commands()
        time.sleep(warm_up)
        progress(f"CPU load over {cost:.0f} s")
        shares = _shares(graph, cost)
        progress(f"delays over {listen:.0f} s")
        delays = 1e3 * np.array(_delays(graph, listen))
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


def _compare(progress: Callable[[str], None], listen: float, warm_up: float) -> dict:
    """Return the delays with the inner nodes as processes and in one process, in turn, so that the machine's load is alike."""
    delays: dict[bool, list[float]] = {False: [], True: []}
    rates = []
    for turn in range(2 * _TURNS):
        composed = turn % 2 == 1
        progress(f"delays with the inner nodes {'in one process' if composed else 'as processes'}, {turn + 1} of {2 * _TURNS}")
        with RunningGraph(composed=composed) as graph:
            graph.wait_for_commands()
            time.sleep(warm_up)
            found = _delays(graph, listen)
            graph.check()
        delays[composed] += [1e3 * delay for delay in found]
        if composed:
            rates.append(len(found) / listen)
    apart, together = (_summary(np.array(delays[composed])) for composed in (False, True))
    less = {key: round(100.0 * (1.0 - together[key] / apart[key]), 1) for key in ("median", "p99")}
    return {
        "robot": "virtual robot",
        "delay_ms": apart,
        "composed": {"delay_ms": together, "less_pct": less, "commands_hz": round(min(rates), 1)},
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


def _delays(graph: RunningGraph, duration: float) -> list[float]:
    ids = [codec.layout(name).frame_id for name in ("ImuTime", "CommandTrace", *c610.COMMANDS)]
    link, frames, end = CanLink(graph.can, ids), [], time.monotonic() + duration
    link.open()
    while time.monotonic() < end:
        frames += link.receive(0.05)
    link.close()
    return delays_of(frames)


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
