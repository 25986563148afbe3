"""The colcon workspace: messages and node packages built into `.workspace`, and the environment that finds them."""

import os
import shutil
import subprocess
from collections import deque
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.environment.interpreter import Interpreter
from gravcomp.environment.packages import tools_folder
from gravcomp.environment.progress import Progress

PACKAGES = ("src", "gravcomp_msgs", "gravcomp_node", "gravcomp_hw", "gravcomp_estimation", "gravcomp_fem")


def build(root: Path, python: Interpreter, inner: Path) -> "dict[str, str]":
    """Build all packages; returns the search paths that a shell would have after sourcing the workspace. Raises SetupError."""
    # colcon's own default also has make's limit of load, which leaves one job where anything else runs.
    environment = {"MAKEFLAGS": f"-j{os.cpu_count() or 1}", **os.environ}
    if python.ros:
        # The system's colcon writes scripts for the system's Python, which finds our packages by this.
        environment["PYTHONPATH"] = ":".join(filter(None, [str(_site_packages(inner)), os.environ.get("PYTHONPATH")]))
        colcon = ["colcon"]
    else:
        prefix, tools = str(root / ".venv"), tools_folder(root)
        environment.update(
            PATH=f"{prefix}/bin:{tools}/bin:{environment['PATH']}",
            PYTHONPATH=str(tools),
            AMENT_PREFIX_PATH=prefix,
            CMAKE_PREFIX_PATH=prefix,
            CMAKE_GENERATOR="Ninja",
        )
        # By the Python of `.venv`, which colcon writes into the nodes' scripts.
        colcon = [str(inner), str(tools / "bin" / "colcon")]
    base = root / ".workspace"
    _forget_other_maker(base, f"{root} {python.version} {python.ros}")
    command = [
        *colcon, "--log-base", str(base / "log"), "build", "--base-paths", *PACKAGES,
        "--build-base", str(base / "build"), "--install-base", str(base / "install"), "--symlink-install", "--merge-install",
        "--event-handlers", "console_direct-", "console_start_end+",
    ]  # fmt: skip
    last: "deque[str]" = deque(maxlen=40)
    with Progress("Workspace", total=2 * len(PACKAGES)) as progress:
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=root, env=environment
        )
        for line in process.stdout or ():
            last.append(line)
            if line.startswith(("Starting >>>", "Finished <<<")):
                progress.advance(line.split()[2])
        if process.wait() != 0:
            raise SetupError("colcon could not build the workspace:\n" + "".join(last).strip())
    return _search_paths(root, python, inner, environment)


def _forget_other_maker(base: Path, maker: str) -> None:
    """What another Python, another ROS or another place built does not fit: CMake keeps their paths."""
    note = base / "maker"
    if not note.exists() or note.read_text(encoding="utf-8") != maker:
        for name in ("build", "install"):
            shutil.rmtree(base / name, ignore_errors=True)
        note.write_text(maker, encoding="utf-8")


def _search_paths(root: Path, python: Interpreter, inner: Path, environment: dict) -> "dict[str, str]":
    """What sourcing adds, read from a shell once so that no later start has to."""
    bare = {"PATH": environment["PATH"], "HOME": environment.get("HOME", "/")}
    script = f"source '{root}/.workspace/install/local_setup.bash' && env -0"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, env=bare)
    if done.returncode != 0:
        raise SetupError(f"the workspace cannot be sourced:\n{done.stderr.strip()}")
    sourced = dict(item.split("=", 1) for item in done.stdout.split("\0") if "=" in item)
    paths = {name: sourced.get(name, "") for name in ("AMENT_PREFIX_PATH", "LD_LIBRARY_PATH", "PYTHONPATH")}
    # The core from where it stands: its compiled functions are kept by their files' paths, so there should be one.
    paths["PYTHONPATH"] = ":".join(filter(None, [str(root / "src"), paths["PYTHONPATH"]]))
    if python.ros:
        paths["PYTHONPATH"] = ":".join(filter(None, [paths["PYTHONPATH"], str(_site_packages(inner))]))
    else:
        prefix = root / ".venv"
        paths["AMENT_PREFIX_PATH"] = ":".join(filter(None, [paths["AMENT_PREFIX_PATH"], str(prefix)]))
        paths["LD_LIBRARY_PATH"] = ":".join(filter(None, [paths["LD_LIBRARY_PATH"], *_wheel_libraries(prefix, inner)]))
        paths["bootstrapped"] = "1"
    paths["PATH"] = str(inner.parent)
    return paths


def _wheel_libraries(prefix: Path, inner: Path) -> "list[str]":
    """Return the folders that the bootstrapper of the ROS wheels would find, for which it starts each Python twice."""
    return [str(prefix / "lib"), *sorted(str(path) for path in _site_packages(inner).glob("ros_*.libs"))]


def _site_packages(inner: Path) -> Path:
    return next((inner.parent.parent / "lib").glob("python3.*")) / "site-packages"
