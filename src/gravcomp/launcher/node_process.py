"""One node as a process: its executable is found as `ros2 run` finds it, and its process group is ended with it.

A Python executable of this environment is started by a node host, where there is one (`gravcomp.launcher.host_client`), any other
by `exec`.
"""

import contextlib
import functools
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from gravcomp.environment.end_with_parent import end_with_parent
from gravcomp.launcher.host_client import NODE_ENVIRONMENT, HostError, NodeHost, is_alive, runs_in_host

# s that a node has to end after SIGINT, then after SIGTERM, before it is killed.
_PATIENCE = (5.0, 3.0)

ACTIVE_FILE = "GRAVCOMP_ACTIVE_FILE"
"""Environment variable with the path of a file that a node creates when it becomes active at its start."""

GATE_FILE = "GRAVCOMP_GATE_FILE"
"""Environment variable with the path of a file: a node that has configured itself at its start waits for it to become active."""


class LaunchError(RuntimeError):
    """A node cannot be started; the text tells the user why."""


@dataclass(frozen=True)
class NodeSpec:
    """A node to start, as by `ros2 run package executable --ros-args -p NAME:=VALUE -r FROM:=TO`."""

    package: str
    executable: str
    parameters: dict = field(default_factory=dict)
    namespace: str = ""
    remappings: dict = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Full name of the node."""
        return f"{self.namespace.rstrip('/')}/{self.executable}" if self.namespace else self.executable

    def command(self) -> list[str]:
        """Return the command line. Raises LaunchError when the executable is not installed."""
        return [find_executable(self.package, self.executable), *self.arguments()]

    def module_command(self) -> list[str]:
        """Return the command line that runs the module of the executable's name, for tools that are not installed."""
        return [sys.executable, "-m", f"{self.package}.{self.executable}", *self.arguments()]

    def arguments(self) -> list[str]:
        """Return the ROS arguments: parameters, remappings and namespace."""
        arguments = []
        for key, value in self.parameters.items():
            # JSON is YAML: text is quoted, floats keep their decimal point.
            arguments += ["-p", f"{key}:={json.dumps(value)}"]
        for key, value in self.remappings.items():
            arguments += ["-r", f"{key}:={value}"]
        if self.namespace:
            arguments += ["-r", f"__ns:={self.namespace}"]
        return ["--ros-args", *arguments] if arguments else []


def find_executable(package: str, executable: str) -> str:
    """Return `PREFIX/lib/PACKAGE/EXECUTABLE` of the first prefix in AMENT_PREFIX_PATH that has the package.

    Raises LaunchError.
    """
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if p]
    for prefix in prefixes:
        if (Path(prefix) / "share" / "ament_index" / "resource_index" / "packages" / package).exists():
            path = Path(prefix) / "lib" / package / executable
            if os.access(path, os.X_OK):
                return str(path)
            known = sorted(p.name for p in path.parent.glob("*")) if path.parent.exists() else []
            raise LaunchError(f"package '{package}' has no executable '{executable}'; it has: {', '.join(known) or 'none'}")
    raise LaunchError(
        f"package '{package}' is in none of AMENT_PREFIX_PATH ({', '.join(prefixes) or 'empty'}): is the workspace built?"
    )


class NodeProcess:
    """A running node. Raises LaunchError when it cannot be started.

    log: file of its output; environment: added to that of this process; host: starts it when it can; gated: it does not become
    active before `open_gate`.
    """

    def __init__(
        self,
        spec: NodeSpec,
        log: Path,
        environment: dict[str, str] | None = None,
        host: NodeHost | None = None,
        *,
        gated: bool = False,
    ):
        self.spec = spec
        self.log = log
        self._active = log.with_name(log.name + ".active")
        self._active.unlink(missing_ok=True)
        self.gated = gated
        self._gate = log.with_name(log.name + ".gate")
        self._gate.unlink(missing_ok=True)
        gate = {GATE_FILE: str(self._gate)} if gated else {}
        command, own = spec.command(), {ACTIVE_FILE: str(self._active), **gate, **(environment or {})}
        self._way: _Hosted | _Executed
        if host is not None and runs_in_host(command[0]):
            self._way = _Hosted(host, command, log, own)
        else:
            self._way = _Executed(command, log, own)
        self.pid = self._way.pid

    def open_gate(self) -> None:
        """Let the node become active."""
        self._gate.touch()
        self.gated = False

    @property
    def was_active(self) -> bool:
        """Whether the node has become active since it was started."""
        return self._active.exists()

    @property
    def exit_code(self) -> int | None:
        """Exit code, or None while the node runs."""
        return self._way.exit_code

    @property
    def has_ended(self) -> bool:
        """Whether the process has ended. Nodes whose host has ended still run for a moment, with an exit code."""
        return self._way.has_ended

    def why(self) -> str:
        """Return why the node ended: exit code or signal, and its error message or last line of output."""
        code = self.exit_code
        if code is None:
            return "running"
        if reason := self._way.reason:
            return reason
        how = f"ended with code {code}" if code >= 0 else f"was ended by {signal.Signals(-code).name}"
        last = self._last_words()
        return f"{how}: {last}" if last and code else how

    def signal(self, number: int) -> None:
        """Send a signal to the process group."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, number)

    def stop(self) -> None:
        """End the node and its process group: SIGINT, SIGTERM, SIGKILL."""
        stop_together([self])

    def _last_words(self) -> str:
        lines = self.log.read_text(errors="replace", encoding="utf-8").splitlines() if self.log.exists() else []
        lines = [line.strip() for line in lines if line.strip()]
        sentences = [line for line in lines if line.startswith(f"{self.spec.executable}: ")]
        return (sentences or lines or [""])[-1].removeprefix(f"{self.spec.executable}: ")


def stop_together(processes: list[NodeProcess]) -> None:
    """End several nodes in parallel, with their process groups: SIGINT, SIGTERM, SIGKILL."""
    for number, patience in zip((signal.SIGINT, signal.SIGTERM), _PATIENCE):
        for process in processes:
            if not process.has_ended:
                process.signal(number)
        end = time.monotonic() + patience
        while not all(p.has_ended for p in processes) and time.monotonic() < end:
            time.sleep(0.02)
    for process in processes:
        # Also when the node has ended: other processes of its group may still run.
        process.signal(signal.SIGKILL)
        while not process.has_ended:
            time.sleep(0.005)


class _Executed:
    """A process of its own, started by `exec`."""

    reason = ""

    def __init__(self, command: list[str], log: Path, environment: dict[str, str]):
        with open(log, "ab") as output:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                # In a session of its own: Ctrl-C in the terminal reaches the launcher only, which ends the nodes.
                start_new_session=True,
                preexec_fn=functools.partial(end_with_parent, signal.SIGINT),
                env={**NODE_ENVIRONMENT, **os.environ, "PYTHONUNBUFFERED": "1", **environment},
            )
        self.pid = self._process.pid

    @property
    def exit_code(self) -> int | None:
        return self._process.poll()

    @property
    def has_ended(self) -> bool:
        return self._process.poll() is not None


class _Hosted:
    """A process that a node host has forked."""

    def __init__(self, host: NodeHost, command: list[str], log: Path, environment: dict[str, str]):
        self._host = host
        try:
            self.pid = host.start(command, log, environment)
        except HostError as error:
            raise LaunchError(str(error)) from error

    @property
    def exit_code(self) -> int | None:
        code = self._host.exit_code(self.pid)
        return -signal.SIGINT if code is None and not self._host.is_running else code

    @property
    def has_ended(self) -> bool:
        code = self._host.exit_code(self.pid)
        return code is not None or (not self._host.is_running and not is_alive(self.pid))

    @property
    def reason(self) -> str:
        """Why the node ended, when that is the end of its host."""
        return self._host.why_ended() if self._host.exit_code(self.pid) is None and not self._host.is_running else ""
