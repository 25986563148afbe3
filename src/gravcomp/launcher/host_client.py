"""The launcher's end of the connection to the node host, which it starts.

with NodeHost() as host:                       # imports in the background
    pid = host.start([executable, *arguments], log, {"ROS_DOMAIN_ID": "7"})
    host.exit_code(pid)                        # None while it runs
"""

import contextlib
import functools
import json
import os
import select
import signal
import socket
import subprocess
import sys
import uuid
from collections.abc import Iterable
from pathlib import Path

from gravcomp.environment.end_with_parent import end_with_parent
from gravcomp.environment.process_title import PADDING

MARK = "GRAVCOMP_GRAPH"
"""Environment variable of every process of a graph, also of those that a node starts in a session of their own."""

NODE_ENVIRONMENT = {
    # Memory in huge pages where the kernel offers them. A node that wakes 100 times a second finds cold caches each time; with
    # small pages the address translation costs a tenth of its CPU time and a fifth of the loop's latency.
    "GLIBC_TUNABLES": "glibc.malloc.hugetlb=1",
}
"""Variables of every node, unless the user has set them."""

SHARED_MODULES = (
    "importlib.metadata",
    "gravcomp_node",
    "gravcomp_hw.can_bridge",
    "gravcomp_fem.fem_simulator",
    "gravcomp_fem.inverse_controller",
    "gravcomp_estimation.imu_estimator",
    "gravcomp_fem.composed_loop",
    "gravcomp_hw.virtual_robot",
    "gravcomp.launcher.preload:load_type_supports",
    "gravcomp.launcher.preload:call_compiled",
)
"""Modules that a host imports for the nodes of a graph. The viewer's are not among them: no other node needs them."""


class HostError(RuntimeError):
    """The node host cannot start a process; the text tells the user why."""


class NodeHost:
    """The process `gravcomp.launcher.node_host`. Attribute `mark`: value of MARK in the environment of its nodes."""

    def __init__(self, modules: Iterable[str] = SHARED_MODULES):
        self.mark = uuid.uuid4().hex
        self._codes: dict[int, int] = {}
        self._answers: list[dict] = []
        self._received = b""
        self._is_connected = True
        self._connection, theirs = socket.socketpair()
        with theirs:
            number = theirs.fileno()
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "gravcomp.launcher.node_host", str(number), ",".join(modules), PADDING],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C reaches the launcher alone
                # SIGKILL ends also a host that is stopped; its nodes then get SIGINT.
                preexec_fn=functools.partial(end_with_parent, signal.SIGKILL),
                pass_fds=[number],
                env={**NODE_ENVIRONMENT, **os.environ, "PYTHONUNBUFFERED": "1", MARK: self.mark},
            )

    def __enter__(self) -> "NodeHost":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def pid(self) -> int:
        """Process id of the host."""
        return self._process.pid

    def start(self, command: list[str], log: Path, environment: dict[str, str]) -> int:
        """Start a Python file with its arguments. Returns the process id. Raises HostError.

        log: file to which its output is appended; environment: variables added to those of the host.
        """
        request = {"start": command, "log": str(log.absolute()), "environment": environment}
        with contextlib.suppress(OSError):  # reading finds the host's end
            self._connection.sendall(json.dumps(request).encode() + b"\n")
        while not self._answers and self._is_connected:
            self._read(None)
        if not self._answers:
            raise HostError(self.why_ended())
        answer = self._answers.pop(0)
        if "failed" in answer:
            raise HostError(answer["failed"])
        return int(answer["started"])

    def exit_code(self, pid: int) -> int | None:
        """Exit code of a node that was started here, negative after a signal; None while it runs or when it is not known."""
        if self._is_connected:
            self._read(0.0)
        return self._codes.get(pid)

    @property
    def is_running(self) -> bool:
        """Whether the host runs. The kernel ends its nodes by SIGINT when it does not."""
        if self._is_connected:
            self._read(0.0)
        return self._is_connected

    def why_ended(self) -> str:
        """Return why the host has ended."""
        code = self._process.wait()
        how = f"ended with code {code}" if code >= 0 else f"was ended by {signal.Signals(-code).name}"
        return f"ended with the node host (process {self.pid}), which {how}"

    def close(self) -> None:
        """End the host, and by that the nodes that still run. Can be called again."""
        self._is_connected = False
        self._connection.close()
        self._process.kill()
        self._process.wait()

    def _read(self, timeout: float | None) -> None:
        """Read what the host has sent; wait up to `timeout` (s) for something, without limit when it is None."""
        while self._is_connected and select.select([self._connection], [], [], timeout)[0]:
            try:
                chunk = self._connection.recv(65536)
            except ConnectionError:
                chunk = b""
            self._is_connected = bool(chunk)
            self._received += chunk
            while b"\n" in self._received:
                line, _, self._received = self._received.partition(b"\n")
                answer = json.loads(line)
                if "ended" in answer:
                    self._codes[answer["ended"]] = answer["code"]
                else:
                    self._answers.append(answer)
            timeout = 0.0


def runs_in_host(path: str) -> bool:
    """Whether an executable is a Python file for the interpreter of this environment, which a host can run."""
    with open(path, "rb") as file:
        first = file.readline(1024)
    if not first.startswith(b"#!"):
        return False
    words = first[2:].decode(errors="replace").split()
    interpreter = Path(words[0]) if len(words) == 1 else Path()
    # The folder, not the resolved file: that of a virtual environment leads to the Python that it was made of.
    return "python" in interpreter.name and interpreter.parent.resolve() == Path(sys.executable).parent.resolve()


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False
