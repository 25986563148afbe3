"""Model and inverse problem: accuracy against CalculiX, cost of a closed-loop step, the article's baseline, scaling, dynamics.

A closed-loop step consists of the model (assembly, factorisation, cables, condensed compliance) and the inverse problem that
keeps the tip straight while gravity turns at 10 deg/s, at 100 steps per second.
"""

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from gravcomp.bench import engine_control
from gravcomp.description import Elements, Robot, load_robot_file
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.dynamics import DynamicSolver
from gravcomp.full_model.motion import Motion
from gravcomp.inverse import InverseController, straight_target
from gravcomp.mesh import tube_mesh
from gravcomp.reduction.motion import ReducedDynamicSolver, ReducedMotion
from gravcomp.references.calculix import stored_rows
from gravcomp.references.calculix_cases import stored_cases
from gravcomp.simulation import RobotModel, Simulator

Progress = Callable[[str], None]

_GRAVITY = 9.81
_RATE, _TURN = 100.0, np.deg2rad(10.0)  # steps per second, rad/s
_FALL, _BRIEF_FALL = 0.6, 0.1  # s
_SCALING_STEPS = 30
# The article's mesh has 4,788 linear tetrahedra; this grid has 4,752, six per cell.
_TET4 = {"around": 12, "along": 33, "radial": 2}


def run(progress: Progress, *, every: int = 1) -> dict:
    """Return all figures, computed on every `every`-th of the rows, directions and steps; see the functions below."""
    return {
        **calculix_error(progress, every),
        **full_step(progress, every),
        **engine_control.reduced_model(progress, every),
        "neo_hookean": engine_control.reduced_model(progress, every, law="neo_hookean"),
        **engine_control.compensation(progress, every),
        **engine_control.extreme_targets(progress, every),
        **tet4_step(progress, every),
        **scaling(progress, every),
        **dynamics(progress, every),
    }


def calculix_error(progress: Progress, every: int = 1) -> dict:
    """Return the worst tip error in percent of the length: `calculix_error_pct` over all rows, `calculix_by_body_pct` by body.

    The bodies are the plain tube and those of `references.calculix_cases`, each with its laws.
    """
    rows = [(f"tube, {row.law}", row.robot, row.inclination, row.tip) for row in stored_rows()]
    rows += [(f"{case.name}, {case.law}", case.robot, case.inclination, case.tip) for case in stored_cases()]
    rows = rows[::every]
    worst: dict[str, float] = {}
    for number, (name, robot, inclination, tip) in enumerate(rows, 1):
        progress(f"CalculiX, row {number} of {len(rows)}")
        gravity = -_GRAVITY * np.array([np.cos(inclination), 0.0, np.sin(inclination)])
        shape = Simulator(robot, reduced=False).solve(gravity)
        error = float(np.linalg.norm(shape.tip_position - [0.0, 0.0, robot.length] - tip))
        worst[name] = max(worst.get(name, 0.0), 100.0 * error / robot.length)
    return {
        "calculix_error_pct": round(max(worst.values()), 4),
        "calculix_by_body_pct": {name: round(value, 4) for name, value in worst.items()},
    }


def full_step(progress: Progress, every: int = 1) -> dict:
    """Return `full_step_ms`: one closed-loop step of the full model, median and p99."""
    progress("full model, closed loop")
    return {"full_step_ms": _statistics(closed_loop(Simulator(_article(), reduced=False), steps=400 // every))}


def tet4_step(progress: Progress, every: int = 1) -> dict:
    """Return the figures of a mesh of linear tetrahedra, as in the article.

    `tet4_step_ms`: one closed-loop step; `speedup_over_tet4`: of the full model, in the same run; `tet4_sag_mm`, `full_sag_mm`:
    deflection of the tip of both, horizontal and released.
    """
    progress("linear tetrahedra, the article's kind of mesh")
    robot = _article()
    baseline = Simulator(RobotModel(robot, tube_mesh(robot, "tet4", **_TET4)), reduced=False)
    full = Simulator(robot, reduced=False)
    sag = [s.solve(np.array([-_GRAVITY, 0.0, 0.0])).tip_position[0] for s in (baseline, full)]
    slow, fast = closed_loop(baseline, max(2, 60 // every), 50 // every), closed_loop(full, 200 // every)
    return {
        "tet4_step_ms": _statistics(slow),
        "speedup_over_tet4": round(float(np.median(slow) / np.median(fast)), 1),
        "tet4_sag_mm": round(1e3 * float(sag[0]), 2),
        "full_sag_mm": round(1e3 * float(sag[1]), 2),
    }


def scaling(progress: Progress, every: int = 1) -> dict:
    """Return `scaling`: ms of a model step over elements along the robot and over the number of cables, with exponents."""
    robot = _article()
    along = {}
    for count in (10, 20, 40, 80)[: max(2, 4 // every)]:
        progress(f"scaling, {count} elements along the robot")
        finer = dataclasses.replace(robot, elements=dataclasses.replace(robot.elements or Elements(), along=count))
        along[count] = _model_step(finer, every)
    cables = {}
    for count in (3, 6, 12, 24)[: max(2, 4 // every)]:
        progress(f"scaling, {count} cables")
        around = [dataclasses.replace(robot.cables[3], name=f"c{i}", angle=2.0 * np.pi * i / count) for i in range(count)]
        cables[count] = _model_step(dataclasses.replace(robot, cables=tuple(around)), every)
    return {
        "scaling": {
            "elements_along_ms": along,
            "elements_along_exponent": _exponent(along),
            "cables_ms": cables,
            "cables_exponent": _exponent(cables),
        }
    }


def dynamics(progress: Progress, every: int = 1) -> dict:
    """Return the figures of a free fall of 0.6 s (every > 1: 0.1 s), from the straight horizontal robot.

    `dynamics_error_mm`, `dynamics_full_error_mm`: worst tip error of reduced and full model at steps of 10 ms, against the full
    model at 0.5 ms; `dynamics_step_ms`, `dynamics_full_step_ms`: one step.
    """
    model, duration = RobotModel(_article()), _FALL if every == 1 else _BRIEF_FALL
    progress("dynamics, reference")
    reference, _ = _fall(DynamicSolver(model), model, 0.5e-3, duration)
    progress("dynamics, 10 ms")
    figures: dict = {}
    for name, solver in (("dynamics", engine_control.reduced_motion(model, progress)), ("dynamics_full", DynamicSolver(model))):
        coarse, times = _fall(solver, model, 10e-3, duration)
        error = np.linalg.norm(coarse - reference[19::20], axis=1).max()
        figures |= {f"{name}_error_mm": round(1e3 * float(error), 3), f"{name}_step_ms": _statistics(times)}
    return figures


def closed_loop(simulator: Simulator, steps: int, warm_up: int = 50) -> np.ndarray:
    """Return the time (steps,) in s of each closed-loop step, model and inverse problem, after `warm_up` further steps."""
    robot = simulator.robot
    controller = InverseController(robot)
    target = straight_target(robot.length)
    simulator.reset()
    displacement, times = None, []
    for step in range(warm_up + steps):
        angle = _TURN * step / _RATE
        shape = simulator.step(-_GRAVITY * np.array([np.cos(angle), 0.0, np.sin(angle)]), displacement)
        command = controller.step(
            shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=1.0 / _RATE
        )
        displacement = command.displacement
        times.append(shape.solve_time + command.solve_time)
    return np.array(times[warm_up:])


def _fall(
    solver: DynamicSolver | ReducedDynamicSolver, model: RobotModel, h: float, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return tip positions (k, 3) in m of a free fall with released cables, and the time (k,) in s of each step."""
    gravity = np.array([-_GRAVITY, 0.0, 0.0])
    nodes = model.mesh.nodes

    def place() -> None:
        if isinstance(solver, DynamicSolver):
            solver.place(np.zeros_like(nodes), gravity=gravity)
        else:
            solver.place(np.zeros(solver.model.size), np.zeros(model.tendons.count), gravity)

    place()
    solver.step(gravity, CableInput(), h)  # the first one compiles
    place()
    tips, times = [], []
    for _ in range(round(duration / h)):
        begin = time.perf_counter()
        motion = solver.step(gravity, CableInput(), h)
        times.append(time.perf_counter() - begin)
        if not motion.converged:
            raise ArithmeticError(f"a step of {1e3 * h:g} ms did not converge")
        if isinstance(solver, ReducedDynamicSolver) and isinstance(motion, ReducedMotion):
            tips.append(solver.model.tip(motion.q))
        elif isinstance(motion, Motion):
            tips.append(model.effectors.sections(nodes + motion.u)[-1, 0])
    return np.array(tips), np.array(times)


def _model_step(robot: Robot, every: int) -> float:
    """Return the median ms of a model step while gravity turns and every third cable is taut."""
    simulator = Simulator(robot, reduced=False)
    tension = np.where(np.arange(len(robot.cables)) % 3 == 0, 0.2 * 3 / len(robot.cables), 0.0)
    simulator.solve(np.array([-_GRAVITY, 0.0, 0.0]), tension=tension)
    times = []
    for step in range(max(5, _SCALING_STEPS // every)):
        angle = _TURN * step / _RATE
        gravity = -_GRAVITY * np.array([np.cos(angle), 0.0, np.sin(angle)])
        times.append(simulator.step(gravity, tension=tension).solve_time)
    return round(1e3 * float(np.median(times)), 3)


def _exponent(times: dict[int, float]) -> float:
    """Return the slope of log time over log size."""
    return round(float(np.polyfit(np.log(list(times)), np.log(list(times.values())), 1)[0]), 3)


def _statistics(times: np.ndarray) -> dict:
    return {"median": round(1e3 * float(np.median(times)), 3), "p99": round(1e3 * float(np.percentile(times, 99)), 3)}


def _article() -> Robot:
    return load_robot_file("article").robot
