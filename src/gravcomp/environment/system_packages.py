"""System packages that the environment needs: named when missing, installed as root or after a yes."""

import os
import shutil
import subprocess
import sys

from gravcomp.environment.errors import SetupError
from gravcomp.environment.interpreter import Interpreter
from gravcomp.environment.progress import note


def missing_packages(python: Interpreter) -> "dict[str, str]":
    """Debian package -> what it is for."""
    version = "{}.{}".format(*python.version)
    missing = {}
    if not python.ensurepip:
        missing[f"python{version}-venv"] = "virtual environments"
    if not python.headers:
        missing[f"python{version}-dev"] = "Python's headers, for the messages"
    if not shutil.which("g++"):
        missing["g++"] = "a compiler, for the messages"
    if python.ros and not shutil.which("colcon"):
        missing["python3-colcon-common-extensions"] = "colcon"
    return missing


def provide(packages: "dict[str, str]") -> None:
    """Install them as root, or after a yes at the terminal. Raises SetupError with the line to run otherwise."""
    if not packages:
        return
    install(list(packages), ", ".join(f"{name} ({use})" for name, use in packages.items()))


def install(names: "list[str]", wanted: str) -> None:
    """`apt-get install` of the names; `wanted` describes them. Raises SetupError."""
    root = os.geteuid() == 0
    line = ("" if root else "sudo ") + "apt-get install -y --no-install-recommends " + " ".join(names)
    if not shutil.which("apt-get"):
        raise SetupError(f"missing on this machine: {wanted}. Install what provides them here; on Debian and Ubuntu: {line}")
    if not root and not confirmed(f"Missing: {wanted}.\nInstall with '{line}'? [y/N] "):
        raise SetupError(f"missing on this machine: {wanted}. Run: {line}")
    note(f"Installing {wanted}")
    prefix = [] if root else ["sudo"]
    environment = dict(os.environ, DEBIAN_FRONTEND="noninteractive")
    for step in (["update"], ["install", "-y", "--no-install-recommends", *names]):
        done = subprocess.run([*prefix, "apt-get", *step], capture_output=True, text=True, env=environment)
    if done.returncode != 0:
        raise SetupError(f"'{line}' failed:\n{done.stderr.strip() or done.stdout.strip()}")


def confirmed(question: str) -> bool:
    """Ask at the terminal; False without one."""
    if not (sys.stdin and sys.stdin.isatty()):
        return False
    print(question, end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")
