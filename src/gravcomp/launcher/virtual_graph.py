"""The graph on a virtual robot as processes, on a private bus and in a namespace of its own; for the benchmarks."""

import os
import time

import psutil

from gravcomp.canbus import codec
from gravcomp.canbus.link import CanLink
from gravcomp.canbus.multicast import private_channel
from gravcomp.description.hardware import CanInterface
from gravcomp.launcher import Graph
from gravcomp.launcher.host_client import NodeHost
from gravcomp.launcher.page_address import wait_for_page
from gravcomp.launcher.robot_graph import LOOP, RobotGraph
from gravcomp.motors.state import RECOVERY, State

NODES = ("virtual_robot", *(executable for _, executable in LOOP))
"""Executables of the nodes."""

_STATES = {state.name.lower() for state in State}

START_TIMEOUT = 300.0
"""s; on the first start on a machine Numba compiles."""


class RunningGraph:
    """Virtual robot and loop, on request with the viewer; a context manager that starts and ends them.

    parameters: {executable: {parameter: value}}; composed: the inner nodes in one process. Attributes: can (CanInterface),
    namespace, robot (RobotGraph), page (address of the live page).
    """

    def __init__(self, parameters: dict[str, dict] | None = None, *, viewer: bool = False, composed: bool = False):
        self.can = CanInterface(channel=private_channel())
        self.namespace = f"/bench_{os.getpid()}_{self.can.channel.rpartition(':')[2]}"
        self.robot = robot = RobotGraph("article", self.can.interface, self.can.channel, self.namespace, parameters or {})
        specs = [robot.node("gravcomp_hw", "virtual_robot"), *robot.loop(virtual=True, composed=composed)]
        self._viewer = robot.node("gravcomp_fem", "viewer") if viewer else None
        self.page = ""
        self._specs = {spec.executable: spec for spec in specs}
        self._graph = Graph(specs, host=NodeHost())

    def __enter__(self) -> "RunningGraph":
        try:
            if self._viewer:
                # Before the others, as the commands do.
                self._graph.start_one(self._viewer)
                self.page = wait_for_page(self._graph)
            self._graph.start()
        except BaseException:
            self._graph.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._graph.stop()

    def check(self) -> None:
        """Raise NodeDied when a node has ended by itself."""
        self._graph.check()

    def dead(self) -> dict[str, str]:
        """Return the nodes that have ended, by name, with the reason."""
        return self._graph.dead()

    def restart(self, executable: str) -> None:
        """Start a node again that has ended."""
        self._graph.start_one(self._specs[executable])

    def process(self, executable: str) -> psutil.Process:
        """Return the process of a node."""
        return psutil.Process(self._graph.processes[self._specs[executable].name].pid)

    def latched_fault(self) -> str:
        """Return the fault in which the bridge waits for a user, as it has logged it; empty: there is none."""
        log = self._graph.processes[self._specs["can_bridge"].name].log.read_text(encoding="utf-8")
        return last_latched_fault(log)

    def wait_for_commands(self, timeout: float = START_TIMEOUT) -> float:
        """Wait until currents on the bus follow commands. Returns the time in s.

        Raises TimeoutError, at once where the bridge waits in a fault, NodeDied.
        """
        begin = time.monotonic()
        link = CanLink(self.can, [codec.layout("CommandTrace").frame_id])
        link.open()
        try:
            while time.monotonic() - begin < timeout:
                if link.receive(0.1):
                    return time.monotonic() - begin
                self.check()
                if fault := self.latched_fault():
                    raise TimeoutError(f"no command reaches the motors: the bridge has stopped them: {fault}")
        finally:
            link.close()
        raise TimeoutError(f"no command reached the motors within {timeout:.0f} s; the nodes' output is in {self._graph.logs}")


def last_latched_fault(log: str) -> str:
    """Return the fault at the end of a log of the bridge, without what a user can do; empty where it has left it since."""
    for line in reversed(log.splitlines()):
        state, _, message = line.rpartition("]: ")[2].partition(": ")
        if state == "fault":
            return message.partition(RECOVERY)[0] if RECOVERY in message else ""
        if state in _STATES:
            return ""
    return ""
