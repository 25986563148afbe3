"""One node as a process: found as `ros2 run` finds it, ended with all that it started."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

# How long a node may take to end after SIGINT, and then after SIGTERM, before it is killed.
_PATIENCE = (5.0, 3.0)
_PR_SET_PDEATHSIG = 1
_NODE_ENVIRONMENT = {
    # Memory in huge pages where the kernel gives them: a node that wakes a hundred times a second finds its caches cold each time, and
    # with small pages it pays for their addresses, too (a tenth of its processor time, a fifth of the loop's delay).
    "GLIBC_TUNABLES": "glibc.malloc.hugetlb=1",
}
_LIBC = ctypes.CDLL(None, use_errno=True)

ACTIVE_FILE = "GRAVCOMP_ACTIVE_FILE"
"""Environment variable with the path of a file that a node creates when it becomes active at its start."""


class LaunchError(RuntimeError):
    """A node that cannot be started; the text is for people."""


@dataclass(frozen=True)
class NodeSpec:
    """What to start: `ros2 run package executable --ros-args -p NAME:=VALUE -r FROM:=TO`."""

    package: str
    executable: str
    parameters: dict = field(default_factory=dict)
    namespace: str = ""
    remappings: dict = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The node's full name."""
        return f"{self.namespace.rstrip('/')}/{self.executable}" if self.namespace else self.executable

    def command(self) -> list[str]:
        """The command line. Raises LaunchError when the executable is not installed."""
        return [find_executable(self.package, self.executable), *self.arguments()]

    def module_command(self) -> list[str]:
        """The command line of a module with the executable's name that is run with `python -m`, for tools that are not installed."""
        return [sys.executable, "-m", f"{self.package}.{self.executable}", *self.arguments()]

    def arguments(self) -> list[str]:
        """The ROS arguments: parameters, remappings and namespace."""
        arguments = []
        for key, value in self.parameters.items():
            # JSON is YAML: texts are quoted, floats keep their point.
            arguments += ["-p", f"{key}:={json.dumps(value)}"]
        for key, value in self.remappings.items():
            arguments += ["-r", f"{key}:={value}"]
        if self.namespace:
            arguments += ["-r", f"__ns:={self.namespace}"]
        return ["--ros-args", *arguments] if arguments else []


def find_executable(package: str, executable: str) -> str:
    """`<prefix>/lib/PACKAGE/EXECUTABLE` of the first prefix in AMENT_PREFIX_PATH whose index has the package."""
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
    """A running node. Its output goes to `log`; `environment` is added to this process's own."""

    def __init__(self, spec: NodeSpec, log: Path, environment: dict[str, str] | None = None):
        self.spec = spec
        self.log = log
        self._active = log.with_name(log.name + ".active")
        self._active.unlink(missing_ok=True)
        with open(log, "ab") as output:
            self._process = subprocess.Popen(
                spec.command(),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                # A session of its own: Ctrl-C at the terminal reaches the launcher alone, which ends the nodes in order.
                start_new_session=True,
                preexec_fn=_die_with_parent,
                env={
                    **_NODE_ENVIRONMENT,
                    **os.environ,
                    "PYTHONUNBUFFERED": "1",
                    ACTIVE_FILE: str(self._active),
                    **(environment or {}),
                },
            )
        self.pid = self._process.pid

    @property
    def was_active(self) -> bool:
        """Whether the node has become active since it was started."""
        return self._active.exists()

    @property
    def exit_code(self) -> int | None:
        """None while it runs."""
        return self._process.poll()

    def why(self) -> str:
        """Why it ended: its own sentence (or the last line it wrote), and the code or signal."""
        code = self.exit_code
        if code is None:
            return "running"
        how = f"ended with code {code}" if code >= 0 else f"was ended by {signal.Signals(-code).name}"
        last = self._last_words()
        return f"{how}: {last}" if last and code else how

    def signal(self, number: int) -> None:
        """Signal the whole group."""
        try:
            os.killpg(self.pid, number)
        except ProcessLookupError:
            pass

    def stop(self) -> None:
        """End it, gently first. Nothing of its group is left."""
        stop_together([self])

    def _last_words(self) -> str:
        lines = self.log.read_text(errors="replace").splitlines() if self.log.exists() else []
        lines = [line.strip() for line in lines if line.strip()]
        sentences = [line for line in lines if line.startswith(f"{self.spec.executable}: ")]
        return (sentences or lines or [""])[-1].removeprefix(f"{self.spec.executable}: ")


def stop_together(processes: list[NodeProcess]) -> None:
    """End them side by side: SIGINT, SIGTERM, SIGKILL."""
    for number, patience in zip((signal.SIGINT, signal.SIGTERM), _PATIENCE):
        for process in processes:
            if process.exit_code is None:
                process.signal(number)
        end = time.monotonic() + patience
        while any(p.exit_code is None for p in processes) and time.monotonic() < end:
            time.sleep(0.02)
    for process in processes:
        # Also when the node has ended: whatever it left in its group goes with it.
        process.signal(signal.SIGKILL)
        process._process.wait()


def _die_with_parent() -> None:
    """A launcher that is killed outright takes its nodes along."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
