"""Gmsh, an optional package of gravcomp's environment: importing, installing and running it."""

import contextlib
import ctypes
import importlib
import os
import signal
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from gravcomp.environment import system_packages
from gravcomp.environment.errors import SetupError
from gravcomp.environment.packages import provide_extra
from gravcomp.mesh_files.errors import MeshError

SYSTEM_PACKAGES = ("libglu1-mesa", "libgl1", "libopengl0", "libxcursor1", "libxft2", "libxinerama1", "libxfixes3")
"""Debian packages with the system libraries that Gmsh's wheel is linked to."""
INSTALL_LINE = "./gravcomp mesh install"
# Gmsh's numbers of elements.
TRIANGLE, TETRAHEDRON = 2, 4


class GmshMissing(MeshError):
    """Gmsh is not installed, or cannot be loaded; the text names the line that installs it."""


def install_gmsh() -> str:
    """Install Gmsh into the running environment, with its system libraries as root or after a yes; return its version.

    Does nothing where it works already. Raises SetupError.
    """
    provide_extra("mesher")
    importlib.invalidate_caches()
    problem = _problem()
    if isinstance(problem, OSError):
        system_packages.install(list(SYSTEM_PACKAGES), f"system libraries of Gmsh ({problem})")
        problem = _problem()
    if problem is not None:
        raise SetupError(f"Gmsh cannot be loaded: {problem}")
    return str(_imported().__version__)


@contextlib.contextmanager
def gmsh_session(name: str, failure: str) -> Iterator[Any]:
    """Give the module gmsh with an empty model; what Gmsh raises becomes a MeshError with `name` and `failure`.

    Raises MeshError if Gmsh is missing; at a terminal it is installed after a yes.
    """
    gmsh = _provided(name)
    with _silent():
        with _same_reaction_to_closed_pipes():
            gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            yield gmsh
        except MeshError:
            raise
        except Exception as error:  # Gmsh raises plain Exception
            raise MeshError(f"{name}: Gmsh {failure}: {error}") from error
        finally:
            gmsh.finalize()


def mesh_of(gmsh: Any, element_type: int, corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and elements (k, corners) of Gmsh's number `element_type` in its model; none where it made none."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, connectivity = gmsh.model.mesh.getElementsByType(element_type)
    if len(connectivity) == 0:
        return np.zeros((0, 3)), np.zeros((0, corners), dtype=np.int64)
    index = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    index[tags.astype(np.int64)] = np.arange(len(tags))
    used, numbers = np.unique(index[connectivity.astype(np.int64)], return_inverse=True)
    return coordinates.reshape(-1, 3)[used], numbers.reshape(-1, corners)


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Keep what Gmsh's libraries print, whatever their options say, away from stdout, where commands print their result.

    And away from stderr, where they print the same line for each patch that they cannot smooth.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(stream) for stream in (1, 2)]
    try:
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            for stream in (1, 2):
                os.dup2(nowhere.fileno(), stream)
        yield
    finally:
        ctypes.CDLL(None).fflush(None)
        for stream, before in zip((1, 2), kept):
            os.dup2(before, stream)
            os.close(before)


@contextlib.contextmanager
def _same_reaction_to_closed_pipes() -> Iterator[None]:
    """Keep the process's reaction to SIGPIPE, which Python ignores: Gmsh resets it, and a peer that closes would end the process.

    By the C library, because Python sets signals in its main thread only.
    """
    react = ctypes.CDLL(None).signal
    react.argtypes, react.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_void_p
    before = react(signal.SIGPIPE, int(signal.SIG_IGN))
    try:
        yield
    finally:
        react(signal.SIGPIPE, before)


def _provided(name: str) -> Any:
    problem = _problem()
    if problem is None:
        return _imported()
    question = f"{name} is filled by Gmsh, which is not installed (100 MB, GPL). Install it into gravcomp's environment? [y/N] "
    if sys.stdin and sys.stdin.isatty() and system_packages.confirmed(question):
        try:
            install_gmsh()
            return _imported()
        except SetupError as error:
            raise GmshMissing(f"{name}: Gmsh could not be installed: {error}") from error
    missing = "is not installed" if isinstance(problem, ImportError) else f"lacks system libraries ({problem})"
    raise GmshMissing(f"{name}: Gmsh, which fills surfaces and reads STEP files, {missing}; run: {INSTALL_LINE}")


def _problem() -> "ImportError | OSError | None":
    try:
        _imported()
    except (ImportError, OSError) as error:
        return error
    return None


def _imported() -> Any:
    return importlib.import_module("gmsh")
