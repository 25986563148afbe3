"""The running graph: delay from IMU frame to current frame, and what each process costs.

The delay is read from the bus (see gravcomp.judging.bus_delay): from the last frame of an IMU sample to the first current
frame that it caused, through bridge, estimator, simulator and controller, with six motors feeding back at 500 Hz.
"""

import time
from collections.abc import Callable

import numpy as np

from gravcomp.bench.running_graph import NODES, RunningGraph
from gravcomp.canbus import codec
from gravcomp.canbus.link import CanLink
from gravcomp.judging.bus_delay import delays_of

_WARM_UP, _LISTEN, _COST = 5.0, 10.0, 15.0  # s


def run(progress: Callable[[str], None], *, listen: float = _LISTEN, cost: float = _COST) -> dict:
    """`delay_ms` {median, p99, samples}, `bridge_cpu` (share of a core), `cpu` and `memory_mb` by process."""
    with RunningGraph() as graph:
        progress("starting the graph")
        graph.wait_for_commands()
        time.sleep(_WARM_UP)
        progress(f"processor shares over {cost:.0f} s")
        shares = _shares(graph, cost)
        progress(f"delays over {listen:.0f} s")
        delays = 1e3 * np.array(_delays(graph, listen))
        graph.check()
        memory = {name: graph.process(name).memory_info().rss / 2**20 for name in NODES}
    if len(delays) == 0:
        raise TimeoutError("no command was traced on the bus while listening")
    return {
        "robot": "virtual robot",
        "delay_ms": {
            "median": round(float(np.median(delays)), 2),
            "p99": round(float(np.percentile(delays, 99)), 2),
            "samples": len(delays),
        },
        "bridge_cpu": shares["can_bridge"],
        "cpu": shares,
        "memory_mb": {name: round(value, 1) for name, value in memory.items()},
    }


def _shares(graph: RunningGraph, duration: float) -> dict[str, float]:
    processes = {name: graph.process(name) for name in NODES}
    before, begin = {name: sum(p.cpu_times()[:2]) for name, p in processes.items()}, time.monotonic()
    time.sleep(duration)
    elapsed = time.monotonic() - begin
    return {name: round((sum(p.cpu_times()[:2]) - before[name]) / elapsed, 3) for name, p in processes.items()}


def _delays(graph: RunningGraph, duration: float) -> list[float]:
    ids = [codec.layout(name).frame_id for name in ("ImuTime", "CommandTrace", "MotorCommand1to4", "MotorCommand5to8")]
    link, frames, end = CanLink(graph.can, ids), [], time.monotonic() + duration
    link.open()
    while time.monotonic() < end:
        frames += link.receive(0.05)
    link.close()
    return delays_of(frames)
