"""A graph of several nodes: started in order, watched, ended together."""

import contextlib
import os
import signal
import tempfile
import time
import uuid
from collections.abc import Callable
from pathlib import Path

from gravcomp.launcher.host_client import MARK, NodeHost
from gravcomp.launcher.node_process import NodeProcess, NodeSpec, stop_together

_POLL = 0.02  # s
_LEFTOVER_PATIENCE = 2.0  # s between SIGTERM and SIGKILL


class NodeDied(RuntimeError):
    """A node ended by itself; the text names it and the reason."""


class Graph:
    """The processes of a graph.

    specs: nodes in the order of their start. logs: folder for their output, by default a new temporary one. environment:
    variables added to the processes' environment. host: starts the nodes by forking; the graph ends it.
    """

    def __init__(
        self,
        specs: list[NodeSpec],
        logs: Path | None = None,
        environment: dict[str, str] | None = None,
        host: NodeHost | None = None,
    ):
        self.specs = specs
        self.logs = Path(logs or tempfile.mkdtemp(prefix="gravcomp-"))
        self.logs.mkdir(parents=True, exist_ok=True)
        self.processes: dict[str, NodeProcess] = {}
        self._host = host
        self._mark = host.mark if host else uuid.uuid4().hex
        self._environment = {**(environment or {}), MARK: self._mark}

    def __enter__(self) -> "Graph":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Start all nodes. Raises LaunchError; the nodes started before are then ended."""
        try:
            for spec in self.specs:
                self.start_one(spec)
        except BaseException:
            self.stop()
            raise

    def start_one(self, spec: NodeSpec, *, gated: bool = False) -> NodeProcess:
        """Start one node, or start it again; gated: it becomes active when its gate is opened."""
        log = self.logs / (spec.name.strip("/").replace("/", "_") + ".log")
        process = NodeProcess(spec, log, self._environment, self._host, gated=gated)
        self.processes[spec.name] = process
        return process

    def dead(self) -> dict[str, str]:
        """Return the nodes that have ended, by name, with the reason."""
        return {name: process.why() for name, process in self.processes.items() if process.exit_code is not None}

    def check(self) -> None:
        """Raise NodeDied when a node has ended."""
        dead = self.dead()
        if dead:
            raise NodeDied("; ".join(f"{name} {why}" for name, why in dead.items()))

    def were_active(self) -> bool:
        """Whether every node has become active since it was started, apart from those whose gate is closed."""
        return all(process.was_active for process in self.processes.values() if not process.gated)

    def states(self) -> dict[str, str]:
        """Return 'running' or the reason of its end for each node."""
        return {name: process.why() for name, process in self.processes.items()}

    def wait(self, done: Callable[[], bool], timeout: float, what: str) -> None:
        """Wait until `done()`. Raises NodeDied when a node ends before, TimeoutError with `what` after `timeout` s."""
        end = time.monotonic() + timeout
        while not done():
            self.check()
            if time.monotonic() > end:
                raise TimeoutError(f"{what} did not happen within {timeout:.0f} s; the nodes' output is in {self.logs}")
            time.sleep(_POLL)

    def stop_except(self, executable: str) -> None:
        """End all nodes in parallel, but not those of this executable."""
        stop_together([process for process in self.processes.values() if process.spec.executable != executable])

    def stop(self) -> None:
        """End all nodes in parallel, and the processes that they started."""
        stop_together(list(self.processes.values()))
        if self._host is not None:
            self._host.close()
        self._end_leftovers()

    def _end_leftovers(self) -> None:
        """End the processes that nodes started in other sessions (the guard of the bridge): SIGTERM, then SIGKILL."""
        end = time.monotonic() + _LEFTOVER_PATIENCE
        number = signal.SIGTERM
        while leftovers := _marked(self._mark):
            for pid in leftovers:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)
            number = signal.SIGTERM if time.monotonic() < end else signal.SIGKILL
            time.sleep(0.05)


def _marked(mark: str) -> list[int]:
    """Return the ids of the processes that have the mark in their environment."""
    needle = f"{MARK}={mark}".encode()
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if needle in (folder / "environ").read_bytes() and (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:  # it has ended, or belongs to another user
            continue
    return found
