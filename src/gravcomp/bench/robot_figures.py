"""Figures of one robot's model, as described in its file."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from gravcomp.bench.engine_control import reduced_figures
from gravcomp.description import load_robot_file
from gravcomp.full_model.mesh_error import error_of_mesh
from gravcomp.reduction import load
from gravcomp.simulation import RobotModel, Simulator
from gravcomp.training import build

FIGURES = {
    "build_s": "build of the reduced model",  # the first: the others leave the chosen mesh in the cache
    "mesh_error_pct": "mesh against one that is twice as fine each way",
    "rest_error_pct": "shape without load and gravity",
    "reduced_step_ms": "step of the reduced model",
    "reduced_error_pct": "reduced against full model",
}
OF_THE_MESH = ("mesh_error_pct", "rest_error_pct")
"""Those that no load on the machine changes, and that need no reduced model."""


def measure(name: str, file: str, every: int = 1, progress: Callable[[str], None] = lambda stage: None) -> dict[str, Any]:
    """Return one of `FIGURES`, and what else the same computation gives. progress: called with what is computed.

    `mesh_error_pct`: distance of the tips, worst of the loads of `full_model.mesh_loads`, in percent of the length;
    `rest_error_pct`: distance of the tip from where it is described, in percent; `build_s`: CPU time from the file to the
    reduced model, on one core; `reduced_step_ms`: one closed-loop step with the inverse problem, median; `reduced_error_pct`:
    worst tip error against the full model in the closed loop at 10 and 90 deg/s, in percent; `reduced_share`: share of these
    steps that the reduced model computed. Raises MeshError, ConfigError, ArithmeticError.
    """
    if name == "build_s":
        begin = time.process_time()
        build(RobotModel(load_robot_file(file).robot), progress=lambda stage, share: progress(f"{stage}, {100 * share:.0f} %"))
        return {name: round(time.process_time() - begin, 1)}
    model = RobotModel(load_robot_file(file).robot)
    if name == "mesh_error_pct":
        elements = model.robot.elements
        described = {} if elements is None else {"elements": [elements.around, elements.along, elements.radial]}
        return {name: round(100.0 * error_of_mesh(model.robot, progress), 4)} | described
    if name == "rest_error_pct":
        shape = Simulator(model, reduced=False).solve(np.zeros(3))
        described = model.mesh.axis.points(np.array([[0.0, 0.0, model.length]]))[0]
        return {name: 100.0 * float(np.linalg.norm(shape.tip_position - described)) / model.length}
    if load(model) is None:
        build(model)
    # One slow path would hide the other figure, so both come from the same run.
    figures = reduced_figures(model, progress, every)
    return {
        "reduced_step_ms": figures["reduced_step_ms"]["median"],
        "reduced_error_pct": round(0.1 * figures["reduced_error_mm"] / model.length, 5),
        "reduced_share": figures["reduced_share"],
    }
