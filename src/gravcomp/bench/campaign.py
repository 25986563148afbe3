"""A running graph under test: bringing it to the state ACTIVE, and the time of its response to a fault."""

import random
import signal
import time
from collections.abc import Callable

from gravcomp.bench.current_monitor import CurrentMonitor
from gravcomp.bench.probe import Probe
from gravcomp.description import load_robot_file
from gravcomp.launcher.virtual_graph import NODES, RunningGraph
from gravcomp.motors.state import State

SAFE_TIMEOUT = 2.0  # s, longest wait for a safe state
_SETTLED = 0.3  # s in the state ACTIVE before a fault is injected


class Campaign:
    """A running graph with its probe and monitor.

    Attributes: limit (A, of the currents), crashes (processes that ended by themselves), begin (s, host: the last injection).
    """

    def __init__(self, graph: RunningGraph, seed: int) -> None:
        self.limit = load_robot_file("article").hardware.drive.current_limit
        self.graph, self.probe, self.monitor = graph, Probe(graph), CurrentMonitor(graph, self.limit)
        self.random = random.Random(seed)
        self.crashes: list[str] = []
        self.begin = 0.0

    def close(self) -> None:
        """End probe and monitor."""
        self.probe.close()
        self.monitor.close()

    def make_active(self, timeout: float = 60.0) -> bool:
        """Wait until commands are followed; return whether they are. Calls `~/resume` after a latched fault or a stop."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            followed = self.monitor.trace_after(time.time(), 1.5)
            last = self.probe.states[-1] if self.probe.states else None
            if followed and last and last.state is State.ACTIVE and time.time() - last.time > _SETTLED and self.probe.match():
                return True
            if last and (last.state is State.STOPPED or (last.state is State.FAULT and "resume" in last.message)):
                self.probe.call("can_bridge/resume")
        return False

    def time_to_safe(self, inject: Callable[["Campaign"], None], *, zero: bool, silent_imu: bool = False) -> float | None:
        """Inject a fault; return ms until the response, or None when there is none.

        zero: the response is zero current, else holding; silent_imu: count from the last valid IMU frame on the bus.
        """
        self.begin = time.time()
        inject(self)
        if not zero and self.probe.state_at(self.begin) is not State.ACTIVE:
            return 0.0  # it was holding, or without current, before the fault
        if zero:
            safe = self.monitor.zero_since(self.begin, SAFE_TIMEOUT)
        else:
            seen = self.probe.wait_for(set(State) - {State.ACTIVE}, self.begin, SAFE_TIMEOUT)
            safe = seen.time if seen else None
        if safe is None:
            return None
        return 1e3 * (safe - (max(self.begin, self.monitor.last_sample) if silent_imu else self.begin))

    def clear_faults(self) -> None:
        """End every fault and resume every stopped process."""
        for executable in NODES:
            self.graph.process(executable).send_signal(signal.SIGCONT)
        self.probe.fault()
        self.probe.enable(True)

    def note_dead(self) -> None:
        """Record the processes that ended by themselves as crashes, and restart them."""
        for name, why in self.graph.dead().items():
            self.crashes.append(f"{name} {why}")
            self.graph.restart(name.rpartition("/")[2])
