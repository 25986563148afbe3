"""Prepare a robot before its nodes start: check its file, compile what they run, build its reduced model in the background."""

import contextlib
import subprocess
from typing import TYPE_CHECKING

from gravcomp.commands import output
from gravcomp.commands.mesh_steps import mesh_steps
from gravcomp.launcher import compilation
from gravcomp.launcher.model_builder import ModelBuilder
from gravcomp.launcher.robot_graph import check_robot_file

if TYPE_CHECKING:
    from gravcomp.description import Robot


def prepare(robot: str, virtual: bool, seed: int | None = None) -> ModelBuilder:
    """Check the robot's file and compile what its nodes run, where that is not done yet. Raises ConfigError.

    virtual: with the virtual robot, whose seed and drawn values are shown; seed: in place of the file's. Returns the builder of
    the reduced model, a context manager. From its `start` on a process of low priority builds the model if it is missing, and the
    nodes use it as soon as it is stored.
    """
    from gravcomp.description import load_robot_file

    summary = check_robot_file(robot, seed)
    if virtual:
        output.note(summary)
    file = load_robot_file(robot)
    parts = compilation.LOOP + (compilation.VIRTUAL if virtual else ())
    compile_parts(parts + compilation.around(file.scene, file.zones, virtual))
    choose_mesh(file.robot)
    return ModelBuilder(robot)


def choose_mesh(described: "Robot") -> None:
    """Choose the robot's mesh, once for a robot, where its file gives none: the simulator would do it without a word.

    A robot without a mesh is left to what needs the mesh, which reports the error.
    """
    from gravcomp.full_model.chosen_elements import is_chosen, with_chosen_elements
    from gravcomp.mesh.mesh import MeshError

    with contextlib.suppress(MeshError):
        if is_chosen(described):
            return
    what = f"choosing the mesh of {described.name}, once for this robot (up to a minute)"
    with mesh_steps(what), contextlib.suppress(MeshError):
        with_chosen_elements(described)


def compile_parts(parts: tuple[str, ...]) -> None:
    """Wait until these parts are compiled, with a note. A part that fails is left to what needs it, which reports the error."""
    missing = compilation.missing(parts)
    if not missing:
        return
    processes = compilation.start(missing)
    try:
        what = ", ".join(part.replace("_", " ") for part in missing)
        text = f"compiling, once for this machine (a minute or two): {what}"
        if not output.console().is_terminal:
            output.note(text)  # there a status is not shown
        with output.busy(text):
            for part, process in zip(missing, processes):
                _, errors = process.communicate()
                if process.returncode:
                    last = (errors.strip().splitlines() or [""])[-1]
                    output.note(f"compiling the {part} failed ({last}); it is compiled where it is needed")
    finally:
        for process in processes:
            _end(process)


def _end(process: subprocess.Popen) -> None:
    if process.poll() is None:
        process.terminate()
        process.wait()
