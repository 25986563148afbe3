"""Several nodes as one: started in order, watched, ended together."""

import os
import signal
import tempfile
import time
import uuid
from collections.abc import Callable
from pathlib import Path

from gravcomp.launcher.node_process import NodeProcess, NodeSpec, stop_together

_MARK = "GRAVCOMP_GRAPH"
_LEFTOVER_PATIENCE = 2.0  # s between SIGTERM and SIGKILL


class NodeDied(RuntimeError):
    """A node ended by itself; the text says which and why."""


class Graph:
    """The processes of a graph.

    specs: in the order in which they are started; logs: folder for their output (a new temporary one when not given);
    environment: added to the processes' environment.
    """

    def __init__(self, specs: list[NodeSpec], logs: Path | None = None, environment: dict[str, str] | None = None):
        self.specs = specs
        self.logs = Path(logs or tempfile.mkdtemp(prefix="gravcomp-"))
        self.logs.mkdir(parents=True, exist_ok=True)
        self.processes: dict[str, NodeProcess] = {}
        # Every process of the graph carries this mark, also those that a node put into a session of their own.
        self._mark = uuid.uuid4().hex
        self._environment = {**(environment or {}), _MARK: self._mark}

    def __enter__(self) -> "Graph":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Start all. Raises LaunchError; what was started until then is ended."""
        try:
            for spec in self.specs:
                self.start_one(spec)
        except BaseException:
            self.stop()
            raise

    def start_one(self, spec: NodeSpec) -> NodeProcess:
        """Start (or start again) one node."""
        log = self.logs / (spec.name.strip("/").replace("/", "_") + ".log")
        process = NodeProcess(spec, log, self._environment)
        self.processes[spec.name] = process
        return process

    def dead(self) -> dict[str, str]:
        """Nodes that have ended: name and why."""
        return {name: process.why() for name, process in self.processes.items() if process.exit_code is not None}

    def check(self) -> None:
        """Raises NodeDied when a node has ended."""
        dead = self.dead()
        if dead:
            raise NodeDied("; ".join(f"{name} {why}" for name, why in dead.items()))

    def were_active(self) -> bool:
        """Whether every node has become active since it was started."""
        return all(process.was_active for process in self.processes.values())

    def states(self) -> dict[str, str]:
        """'running' or why it ended, for each node."""
        return {name: process.why() for name, process in self.processes.items()}

    def wait(self, done: Callable[[], bool], timeout: float, what: str) -> None:
        """Until `done()`; raises NodeDied when a node ends before, TimeoutError naming `what` after `timeout` (s)."""
        end = time.monotonic() + timeout
        while not done():
            self.check()
            if time.monotonic() > end:
                raise TimeoutError(f"{what} did not happen within {timeout:.0f} s; the nodes' output is in {self.logs}")
            time.sleep(0.05)

    def stop(self) -> None:
        """End all, side by side; nothing is left."""
        stop_together(list(self.processes.values()))
        self._end_leftovers()

    def _end_leftovers(self) -> None:
        """What nodes started for themselves (the bridge's guard) goes after them, gently first."""
        end = time.monotonic() + _LEFTOVER_PATIENCE
        number = signal.SIGTERM
        while leftovers := _marked(self._mark):
            for pid in leftovers:
                try:
                    os.kill(pid, number)
                except ProcessLookupError:
                    pass
            number = signal.SIGTERM if time.monotonic() < end else signal.SIGKILL
            time.sleep(0.05)


def _marked(mark: str) -> list[int]:
    """Processes that carry the mark in their environment."""
    needle = f"{_MARK}={mark}".encode()
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if needle in (folder / "environ").read_bytes() and (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:  # it has ended, or is somebody else's
            continue
    return found
