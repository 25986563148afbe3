"""Prepare a robot before its nodes start: check its file, compile what they run, build its reduced model in the background."""

import contextlib
import subprocess

from gravcomp.commands import output
from gravcomp.launcher import compilation
from gravcomp.launcher.model_builder import ModelBuilder
from gravcomp.launcher.robot_graph import check_robot_file


def prepare(robot: str, virtual: bool, seed: int | None = None) -> ModelBuilder:
    """Check the robot's file and compile what its nodes run, where that is not done yet. Raises ConfigError.

    virtual: with the virtual robot, whose seed and drawn values are shown; seed: in place of the file's. Returns the builder of
    the reduced model, a context manager. From its `start` on a process of
    low priority builds the model if it is missing, and the nodes use it as soon as it is stored.
    """
    summary = check_robot_file(robot, seed)
    if virtual:
        output.note(summary)
    _compile(virtual)
    _choose_mesh(robot)
    return ModelBuilder(robot)


def _choose_mesh(robot: str) -> None:
    """Choose the robot's mesh, once for a robot, where its file gives none: the simulator would do it without a word.

    A robot without a mesh is left to the nodes, which report the error.
    """
    from gravcomp.description import load_robot_file
    from gravcomp.full_model.mesh_choice import with_chosen_elements
    from gravcomp.mesh.mesh import MeshError

    described = load_robot_file(robot).robot
    what = f"choosing the mesh of {described.name}, once for this robot (up to half a minute)"
    with output.console().status(what), contextlib.suppress(MeshError):
        with_chosen_elements(described)


def _compile(virtual: bool) -> None:
    """Wait until all parts are compiled. A part that fails is left to the nodes, which report the error."""
    missing = compilation.missing(compilation.LOOP + (compilation.VIRTUAL if virtual else ()))
    if not missing:
        return
    processes = compilation.start(missing)
    try:
        with output.console().status("compiling, once for this machine (about a minute)"):
            for part, process in zip(missing, processes):
                _, errors = process.communicate()
                if process.returncode:
                    last = (errors.strip().splitlines() or [""])[-1]
                    output.note(f"compiling the {part} failed ({last}); the nodes compile it")
    finally:
        for process in processes:
            _end(process)


def _end(process: subprocess.Popen) -> None:
    if process.poll() is None:
        process.terminate()
        process.wait()
