"""From `./gravcomp COMMAND` to the command: make the environment when it is missing or out of date, then enter it."""

import contextlib
import fcntl
import hashlib
import json
import os
import pwd
import signal
import subprocess
import sys
from pathlib import Path
from typing import Iterator

from gravcomp.environment import packages, system_packages, workspace
from gravcomp.environment.end_with_parent import end_with_parent
from gravcomp.environment.errors import SetupError
from gravcomp.environment.interpreter import choose_interpreter
from gravcomp.environment.middleware import middleware
from gravcomp.environment.progress import note

COMPILED_PARTS = ("virtual_robot", "controller", "model")
"""Parts of gravcomp.launcher.compilation, the longest first."""

SEARCH_PATHS = ("AMENT_PREFIX_PATH", "LD_LIBRARY_PATH", "PYTHONPATH", "PATH")


def enter(root: Path, arguments: "list[str]") -> int:
    """Replace this process by the command in its environment; return 3 or 130 when the environment cannot be made."""
    # A bare environment has neither; ROS logs below HOME, and the build looks its tools up in PATH.
    os.environ.setdefault("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin")
    os.environ.setdefault("HOME", pwd.getpwuid(os.geteuid()).pw_dir)
    try:
        state = _ready(root) or _make(root)
        # A Ctrl-C while the next interpreter starts waits until somebody is there to answer it.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    except SetupError as error:
        print(f"gravcomp: {error}", file=sys.stderr)
        return 3
    except KeyboardInterrupt:
        print("\ngravcomp: set-up interrupted; the next start takes it up again", file=sys.stderr)
        return 130
    python = state["python"]
    sys.stdout.flush()
    os.execve(python, [python, "-m", "gravcomp.commands", *arguments], environment(root, state["paths"]))


def environment(root: Path, paths: "dict[str, str]") -> "dict[str, str]":
    """The process environment in which commands and nodes run."""
    result = dict(os.environ, GRAVCOMP_ROOT=str(root))
    for name in SEARCH_PATHS:
        parts = [p for p in paths[name].split(":") if p]
        parts += [p for p in os.environ.get(name, "").split(":") if p and p not in parts]
        result[name] = ":".join(parts)
    result.update(middleware(os.environ))
    if paths.get("bootstrapped"):
        result["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"
    # Who wants no bytecode next to the sources gets it elsewhere: without any, every process compiles for one to two seconds.
    if result.pop("PYTHONDONTWRITEBYTECODE", ""):
        result.setdefault("PYTHONPYCACHEPREFIX", str(root / ".workspace" / "bytecode"))
    # One thread for matrices of this size.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        result.setdefault(name, "1")
    return result


def _ready(root: Path) -> "dict | None":
    try:
        state = json.loads((root / ".workspace" / "ready.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if state.get("key") != _key(root, state.get("ros", "")) or not os.access(state.get("python", ""), os.X_OK):
        return None
    return state


def _make(root: Path) -> dict:
    with _alone(root):
        state = _ready(root)  # another process may have made it while this one waited
        if state:
            return state
        python = choose_interpreter()
        system_packages.provide(system_packages.missing_packages(python))
        inner = root / ".venv" / "bin" / "python"
        stamp = root / ".venv" / "packages.key"
        digest = hashlib.sha256(str((root, python.version, python.ros)).encode())
        for lock in (packages.lock_file(root, python), root / packages.BUILD_LOCK):
            digest.update(lock.read_bytes())
        packages_key = digest.hexdigest()
        tools = python.ros or packages.tools_folder(root).is_dir()
        if not (tools and stamp.exists() and stamp.read_text(encoding="utf-8") == packages_key):
            inner = packages.build(root, python)
            stamp.write_text(packages_key, encoding="utf-8")
        _start_compiling(root, inner)
        paths = workspace.build(root, python, inner)
        state = {"key": _key(root, python.ros), "ros": python.ros, "python": str(inner), "paths": paths}
        partial = root / ".workspace" / "ready.json.partial"
        partial.write_text(json.dumps(state, indent=1), encoding="utf-8")
        partial.replace(partial.with_suffix(""))
        return state


def _start_compiling(root: Path, inner: Path) -> None:
    """Compile the functions of the nodes next to the build of the workspace; a command that starts nodes waits for the rest.

    The processes end with this one, also after it has become the command.
    """
    search = ":".join(filter(None, [str(root / "src"), os.environ.get("PYTHONPATH")]))
    for part in COMPILED_PARTS:
        subprocess.Popen(
            [str(inner), "-m", "gravcomp.launcher.compilation", part],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=dict(os.environ, PYTHONPATH=search), preexec_fn=end_with_parent,
        )  # fmt: skip


def _key(root: Path, ros: str) -> str:
    """Everything that makes the environment: the place, the ROS, the locks, the messages, the packages' files.

    Python files do not count, because the workspace links to their folders.
    """
    sourced = os.environ.get("AMENT_PREFIX_PATH", "").split(":")[-1] if os.environ.get("ROS_DISTRO") else ""
    digest = hashlib.sha256(f"{root}|{ros}|{sourced}".encode())
    product = "requirements-installed-ros.lock" if ros else "requirements.lock"
    files = [root / product, root / packages.BUILD_LOCK, root / "colcon.meta"]
    files += [root / "src" / name for name in ("package.xml", "setup.py", "setup.cfg")]
    for package in workspace.PACKAGES[1:]:
        files += [p for p in (root / package).rglob("*") if p.is_file() and _is_built(p)]
    for path in sorted(files):
        digest.update(str(path.relative_to(root)).encode())
        if path.suffix != ".py" or path.name == "setup.py":
            digest.update(path.read_bytes() if path.exists() else b"")
    return digest.hexdigest()


def _is_built(path: Path) -> bool:
    if {"__pycache__", "test"} & set(path.parts) or ".egg-info" in str(path) or path.suffix == ".md":
        return False
    return path.suffix != ".py" or path.name == "setup.py"


@contextlib.contextmanager
def _alone(root: Path) -> "Iterator[None]":
    (root / ".workspace").mkdir(exist_ok=True)
    with open(root / ".workspace" / "lock", "w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            note("gravcomp: another start is setting up; waiting for it")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
