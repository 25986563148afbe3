"""Compile what the nodes run, once for a machine, in one process for each part: Numba takes about a minute on an empty cache.

    python -m gravcomp.launcher.compilation PART ...

The set-up starts these processes next to the build of the workspace; a command that starts nodes waits for them. A lock keeps two
processes from compiling the same part, and a mark in the folder of the compiled functions tells that a part is complete.
"""

import fcntl
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from gravcomp.compiled_functions import compiled_folder
from gravcomp.environment.end_with_parent import end_with_parent

if TYPE_CHECKING:
    from gravcomp.full_model.robot_model import RobotModel
    from gravcomp.reduction.reduced_model import ReducedModel
    from gravcomp.scene.scene import Scene
    from gravcomp.simulation import Simulator

LOOP = ("model", "controller")
"""Parts of the nodes of the loop."""

VIRTUAL = ("virtual_robot",)
"""Parts of the virtual robot."""

SURROUNDED = ("contact", "reduced_contact", "surroundings")
"""Parts of a robot with obstacles or zones around it, of both models and of the controller; the set-up does not compile them."""

REDUCED = ("reduced",)
"""Part of the reduced model, at rest and in motion, which is otherwise compiled when one is built."""

ITSELF = ("self_contact",)
"""Part of the model of a robot that touches itself, in addition to SURROUNDED."""

VIRTUAL_ITSELF = ("virtual_self_contact",)
"""Part of a virtual robot that touches itself."""

PARTS = VIRTUAL + LOOP + REDUCED + SURROUNDED + ITSELF + VIRTUAL_ITSELF
"""All parts."""

_CALLED = {
    "reduced": ("model",),
    "contact": ("model",),
    "reduced_contact": ("reduced", "contact"),
    "self_contact": ("contact",),
    "surroundings": ("controller", "contact"),
    "virtual_self_contact": ("virtual_robot",),
}
"""Parts most of whose functions a part calls as well: two processes that begin at the same time would both compile them."""


def around(scene: "Scene", zones: "Scene", virtual: bool) -> tuple[str, ...]:
    """Return the parts that a robot with these obstacles and forbidden zones, and a virtual one, need in addition."""
    itself = ITSELF + (VIRTUAL_ITSELF if virtual else ())
    return (SURROUNDED if scene or zones else ()) + (itself if scene.self_contact else ())


def missing(parts: Iterable[str]) -> list[str]:
    """Return those of the parts that are not compiled yet."""
    folder = compiled_folder()
    return [part for part in parts if not _mark(folder, part).exists()]


def start(parts: Iterable[str]) -> list[subprocess.Popen]:
    """Start one process for each part. They end with the thread that calls this."""
    return [
        subprocess.Popen(
            [sys.executable, "-m", "gravcomp.launcher.compilation", part],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=end_with_parent,
        )
        for part in parts
    ]  # fmt: skip


def compile_part(part: str) -> None:
    """Compile one part after those that it calls, unless it is compiled; wait when another process compiles one of them."""
    folder = compiled_folder()
    mark = _mark(folder, part)
    if mark.exists():
        return
    for called in _CALLED.get(part, ()):
        compile_part(called)
    with open(folder / f"{part}.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not mark.exists():
            run_part(part)
            mark.touch()


def run_part(part: str) -> None:
    """Call all functions of a part, which compiles them or loads them from the cache."""
    _WORK[part]()


def _mark(folder: Path, part: str) -> Path:
    return folder / f"{part}.complete"


def _model() -> None:
    import numpy as np

    from gravcomp.description import load_robot_file
    from gravcomp.simulation import Simulator

    simulator = Simulator(load_robot_file("article").robot, reduced=False)
    simulator.warm_up()
    simulator.step(np.array([0.0, 0.0, -9.81]))


def _contact() -> None:
    """Let the article's robot lie on a floor that rubs, with the full model."""
    import numpy as np

    simulator = _on_a_floor()
    for cables in (None, np.zeros(simulator.model.tendons.count)):
        simulator.step(np.array([-9.81, 0.0, 0.0]), cables)


def _reduced_contact() -> None:
    """Let it do so with a reduced model of a few shapes."""
    from gravcomp.reduction.serving import ReducedServing

    simulator = _on_a_floor()
    ReducedServing(simulator.model, _small_reduced_model(simulator.model), simulator.solver).warm_up()


def _on_a_floor() -> "Simulator":
    from gravcomp.description import load_robot_file
    from gravcomp.scene import PlaneWall, SceneSection
    from gravcomp.scene.scene import Scene
    from gravcomp.simulation import Simulator

    robot = load_robot_file("article").robot
    floor = PlaneWall(name="floor", normal=(1.0, 0.0, 0.0), point=(-0.1 * robot.length, 0.0, 0.0), friction=0.2)
    return Simulator(robot, reduced=False, scene=Scene(SceneSection(planes=(floor,))))


def _itself() -> None:
    """Let the article's robot be ready to touch itself."""
    import numpy as np

    from gravcomp.description import load_robot_file
    from gravcomp.scene import SceneSection
    from gravcomp.scene.scene import Scene
    from gravcomp.simulation import Simulator

    scene = Scene(SceneSection(self_contact=True))
    simulator = Simulator(load_robot_file("article").robot, reduced=False, scene=scene)
    simulator.warm_up()
    simulator.step(np.array([-9.81, 0.0, 0.0]))


def _virtual_itself() -> None:
    from gravcomp.scene import SceneSection
    from gravcomp.scene.scene import Scene
    from gravcomp.virtual.warm_up import warm_up

    warm_up(Scene(SceneSection(self_contact=True)))


def _reduced() -> None:
    import numpy as np

    from gravcomp.description import load_robot_file
    from gravcomp.full_model.cable_input import CableInput
    from gravcomp.full_model.robot_model import RobotModel
    from gravcomp.full_model.statics import StaticSolver
    from gravcomp.reduction.motion import ReducedDynamicSolver
    from gravcomp.reduction.serving import ReducedServing

    model = RobotModel(load_robot_file("article").robot)
    reduced, gravity = _small_reduced_model(model), np.array([-9.81, 0.0, 0.0])
    ReducedServing(model, reduced, StaticSolver(model)).warm_up()
    mass = reduced.basis.T @ model.mass_matrix().multiply(reduced.basis)
    solver = ReducedDynamicSolver(reduced, mass, model.mesh.materials[0].damping_time, model.length)
    solver.place(np.zeros(reduced.size), np.zeros(model.tendons.count), gravity)
    solver.step(gravity, CableInput(), 5e-3)


def _small_reduced_model(model: "RobotModel") -> "ReducedModel":
    """Return a reduced model from a few shapes, which is not stored: it has the types of every other one."""
    from gravcomp.training import BuildOptions, TrainingOptions
    from gravcomp.training.build import trained

    return trained(model, BuildOptions(modes=8, strains=4, training=TrainingOptions(paths=2, steps=8))).reduced_model(model)


def _surroundings() -> None:
    from gravcomp.description import load_robot_file
    from gravcomp.inverse import warm_up

    warm_up(load_robot_file("article").robot, surrounded=True)


def _controller() -> None:
    import numpy as np

    from gravcomp.description import load_robot_file
    from gravcomp.inverse import warm_up
    from gravcomp.inverse.limits import within_limits

    robot = load_robot_file("article").robot
    warm_up(robot)
    cables = np.zeros(len(robot.cables))
    within_limits(cables, cables, robot.limits, 0.0)


def _virtual_robot() -> None:
    from gravcomp.virtual.warm_up import warm_up

    warm_up()


_WORK = {
    "model": _model,
    "controller": _controller,
    "virtual_robot": _virtual_robot,
    "reduced": _reduced,
    "contact": _contact,
    "reduced_contact": _reduced_contact,
    "surroundings": _surroundings,
    "self_contact": _itself,
    "virtual_self_contact": _virtual_itself,
}


def main(parts: list[str]) -> int:
    """Compile the parts; returns 0."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for part in parts:
        compile_part(part)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
