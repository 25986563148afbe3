"""The Python packages: a virtual environment filled from lock files.

`.venv` holds what runs the product (requirements.lock, or requirements-installed-ros.lock for a sourced ROS).
`.workspace/tools` holds what builds the workspace. Further locks (`EXTRAS`) are added to `.venv` by the first command that needs
them.
"""

import fcntl
import hashlib
import importlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from gravcomp.environment.errors import SetupError
from gravcomp.environment.installer import install
from gravcomp.environment.interpreter import Interpreter
from gravcomp.environment.progress import note

BUILD_LOCK = "requirements-build.lock"
EXTRAS = {
    "browser": ("requirements-browser.lock", "Packages for pictures of the page"),
    "mesher": ("requirements-mesher.lock", "Meshers of surfaces"),
    "development": ("requirements-development.lock", "Packages for tests and checks"),
    "clang": ("requirements-clang.lock", "Checker of C code"),
    "reports": ("requirements-reports.lock", "Packages for figures"),
}
"""Locks that are installed on demand: file and title."""

_SUFFICES = {"browser": "playwright", "reports": "matplotlib"}
"""Modules whose presence makes an extra superfluous."""


_TESTED_LIBRARIES = ("numpy", "scipy", "numba")
_SMALLEST_LINKED = 50_000  # bytes


def lock_file(root: Path, python: Interpreter) -> Path:
    """Path of the product's lock for this kind of environment."""
    return root / ("requirements-installed-ros.lock" if python.ros else "requirements.lock")


def build(root: Path, python: Interpreter) -> Path:
    """Make or complete `.venv`, and the build tools where no ROS is sourced; return the Python of `.venv`. Raises SetupError."""
    venv = root / ".venv"
    inner = venv / "bin" / "python"
    if not _usable(inner, python):
        shutil.rmtree(venv, ignore_errors=True)
        options = ["--system-site-packages"] if python.ros else []
        _run([python.path, "-m", "venv", *options, str(venv)], "the virtual environment could not be made")
    install(root, inner, lock_file(root, python), "Python packages")
    if not python.ros:
        install(root, inner, root / BUILD_LOCK, "Build tools", target=tools_folder(root))
        _repair_cmake_paths(venv, inner)
        _remove_tests(venv)
        _link_equal_files(venv)
    return inner


def tools_folder(root: Path) -> Path:
    """Folder of the packages that build the workspace."""
    return root / ".workspace" / "tools"


def provide_extra(name: str, root: "Path | None" = None) -> None:
    """Install the packages of the extra `name` (a key of EXTRAS) into the running environment unless they are there.

    root: the repository, by default that of the running command. A program that uses gravcomp as a library has neither; then
    nothing is installed. Raises SetupError.
    """
    given = root or os.environ.get("GRAVCOMP_ROOT")
    if not given:
        return
    root = Path(given)
    if name in _SUFFICES and importlib.util.find_spec(_SUFFICES[name]):
        return
    lock, title = EXTRAS[name]
    provide_lock(root, lock, title, Path(sys.prefix) / f"{name}.key")


def is_provided(root: Path, lock: str, stamp: Path) -> bool:
    """Return whether `stamp` says that the packages of a lock file in `root` are installed."""
    return _read(stamp) == _key(root / lock)


def provide_lock(root: Path, lock: str, title: str, stamp: Path, target: Path | None = None, notice: str = "") -> None:
    """Install the packages of a lock file in `root` unless `stamp` says that they are.

    target: folder of their own, default the running environment; notice: is said before. Raises SetupError.
    """
    if is_provided(root, lock, stamp):
        return
    stamp.parent.mkdir(parents=True, exist_ok=True)
    with open(stamp.parent / "lock", "w", encoding="utf-8") as alone:
        fcntl.flock(alone, fcntl.LOCK_EX)
        if is_provided(root, lock, stamp):  # installed by another process meanwhile
            return
        if notice:
            note(notice)
        install(root, Path(sys.executable), root / lock, title, target=target)
        importlib.invalidate_caches()
        stamp.write_text(_key(root / lock), encoding="utf-8")


def _key(lock: Path) -> str:
    return hashlib.sha256(lock.read_bytes()).hexdigest()


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


def _usable(inner: Path, python: Interpreter) -> bool:
    """Whether `.venv` is complete, in its place and of this Python; otherwise it is made again."""
    if not inner.exists():
        return False
    probe = "import sys, pip; print(sys.version_info[:2] == {!r}, sys.prefix)".format(python.version)
    answer = subprocess.run([str(inner), "-c", probe], capture_output=True, text=True)
    pip = (
        (inner.parent / "pip").read_text(errors="replace", encoding="utf-8").splitlines()[:1]
        if (inner.parent / "pip").exists()
        else []
    )
    shares = "include-system-site-packages = true" in (inner.parent.parent / "pyvenv.cfg").read_text(encoding="utf-8")
    whole = answer.stdout.split() == ["True", str(inner.parent.parent)] and bool(pip) and str(inner.parent) in pip[0]
    return whole and shares == bool(python.ros)


def _repair_cmake_paths(venv: Path, inner: Path) -> None:
    """Replace the paths of the wheel builder's Python in the ROS wheels' exported CMake files by those of this environment."""
    probe = "import numpy, sysconfig; print(sysconfig.get_paths()['include']); print(numpy.get_include())"
    python_include, numpy_include = _run([str(inner), "-c", probe], "NumPy cannot be imported").splitlines()
    for path in (venv / "share").rglob("*.cmake"):
        text = path.read_text(errors="surrogateescape", encoding="utf-8")
        if "/opt/python/" not in text:
            continue
        text = re.sub(r"/opt/python/[^/;\"]+/lib/python[0-9.]+/site-packages/numpy/_core/include", numpy_include, text)
        text = re.sub(r"/opt/python/[^/;\"]+/include/python[0-9.]+", python_include, text)
        # A new file: the installer may have linked the old one from its cache.
        replacement = path.with_suffix(".repaired")
        replacement.write_text(text, errors="surrogateescape", encoding="utf-8")
        os.replace(replacement, path)


def _remove_tests(venv: Path) -> None:
    """Remove the tests of the large libraries, which nothing imports."""
    for library in _TESTED_LIBRARIES:
        for folder in venv.glob(f"lib/python3.*/site-packages/{library}"):
            for tests in [path for path in folder.rglob("tests") if path.is_dir()]:
                shutil.rmtree(tests, ignore_errors=True)


def _link_equal_files(venv: Path) -> None:
    """Store libraries that several wheels contain, or one wheel under several names, once: wheels cannot hold links."""
    of_size: "dict[int, list[Path]]" = {}
    for path in (venv / "lib").rglob("*.so*"):
        if not path.is_symlink() and path.stat().st_size >= _SMALLEST_LINKED:
            of_size.setdefault(path.stat().st_size, []).append(path)
    for paths in of_size.values():
        first: "dict[bytes, Path]" = {}
        for path in paths if len(paths) > 1 else ():
            digest = hashlib.sha256(path.read_bytes()).digest()
            same = first.setdefault(digest, path)
            if not same.samefile(path):
                link = path.with_name(path.name + ".link")
                os.link(same, link)
                os.replace(link, path)


def _run(command: list, failure: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise SetupError(f"{failure}:\n{(done.stderr or done.stdout).strip()}")
    return done.stdout
