"""The Python packages: a virtual environment filled from the lock file, and the ROS wheels' CMake paths mended."""

import os
import re
import shutil
import subprocess
from collections import deque
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.environment.interpreter import Interpreter
from gravcomp.environment.progress import Progress


def lock_file(root: Path, python: Interpreter) -> Path:
    """The lock of this kind of environment."""
    return root / ("requirements-installed-ros.lock" if python.ros else "requirements.lock")


def build(root: Path, python: Interpreter) -> Path:
    """Make or complete `.venv`; returns its Python. Raises SetupError."""
    venv = root / ".venv"
    inner = venv / "bin" / "python"
    if not _usable(inner, python):
        shutil.rmtree(venv, ignore_errors=True)
        options = ["--system-site-packages"] if python.ros else []
        _run([python.path, "-m", "venv", *options, str(venv)], "the virtual environment could not be made")
    _install(inner, lock_file(root, python))
    if not python.ros:
        _mend_cmake_paths(venv, inner)
    return inner


def _usable(inner: Path, python: Interpreter) -> bool:
    """An interrupted or moved environment, or one of another Python, is made anew."""
    if not inner.exists():
        return False
    probe = "import sys, pip; print(sys.version_info[:2] == {!r}, sys.prefix)".format(python.version)
    answer = subprocess.run([str(inner), "-c", probe], capture_output=True, text=True)
    pip = (inner.parent / "pip").read_text(errors="replace").splitlines()[:1] if (inner.parent / "pip").exists() else []
    shares = "include-system-site-packages = true" in (inner.parent.parent / "pyvenv.cfg").read_text()
    whole = answer.stdout.split() == ["True", str(inner.parent.parent)] and bool(pip) and str(inner.parent) in pip[0]
    return whole and shares == bool(python.ros)


def _install(inner: Path, lock: Path) -> None:
    count = sum(1 for line in lock.read_text().splitlines() if re.match(r"^[A-Za-z0-9]", line))
    command = [str(inner), "-m", "pip", "install", "--require-hashes", "--no-deps", "--no-input", "--progress-bar", "off",
               "--disable-pip-version-check", "-r", str(lock)]  # fmt: skip
    last = deque(maxlen=15)
    with Progress("Python packages", total=count + count // 4) as progress:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        for line in process.stdout:
            last.append(line)
            words = line.split()
            if line.startswith(("Collecting ", "Requirement already")):
                progress.advance(words[1] if words[0] == "Collecting" else words[3])
            elif line.startswith("Installing collected"):
                progress.advance("unpacking")
        if process.wait() != 0:
            raise SetupError("pip could not install the locked packages:\n" + "".join(last).strip())
        progress.advance("", progress.total)


def _mend_cmake_paths(venv: Path, inner: Path) -> None:
    """The ROS wheels' exported CMake files name the builder's Python; put this environment's in its place."""
    probe = "import numpy, sysconfig; print(sysconfig.get_paths()['include']); print(numpy.get_include())"
    python_include, numpy_include = _run([str(inner), "-c", probe], "NumPy cannot be imported").splitlines()
    for path in (venv / "share").rglob("*.cmake"):
        text = path.read_text(errors="surrogateescape")
        if "/opt/python/" not in text:
            continue
        text = re.sub(r"/opt/python/[^/;\"]+/lib/python[0-9.]+/site-packages/numpy/_core/include", numpy_include, text)
        text = re.sub(r"/opt/python/[^/;\"]+/include/python[0-9.]+", python_include, text)
        # A file of its own in place of the wheel's: pip may have linked that one from elsewhere.
        replacement = path.with_suffix(".mended")
        replacement.write_text(text, errors="surrogateescape")
        os.replace(replacement, path)


def _run(command: list, failure: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise SetupError(f"{failure}:\n{(done.stderr or done.stdout).strip()}")
    return done.stdout
