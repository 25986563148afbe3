"""The engine: accuracy against CalculiX, cost of a closed-loop step, the article's baseline, scaling, dynamics.

A closed-loop step is the model (assembly, factorisation, cables, condensed compliance) and the inverse problem that keeps the
straight tip while gravity turns at 10 deg/s, at 100 steps a second.
"""

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from gravcomp.bench import engine_control
from gravcomp.description import Robot, load_robot_file
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.dynamics import DynamicSolver
from gravcomp.inverse import InverseController, straight_target
from gravcomp.mesh import tube_mesh
from gravcomp.reduction.motion import ReducedDynamicSolver, ReducedMotion
from gravcomp.references.calculix import REFERENCE, Row, stored_rows
from gravcomp.simulation import RobotModel, Simulator

Progress = Callable[[str], None]

_GRAVITY = 9.81
_RATE, _TURN = 100.0, np.deg2rad(10.0)  # steps a second, rad/s
# The article's mesh has 4,788 linear tetrahedra; six to a cell of this grid make 4,752.
_TET4 = {"around": 12, "along": 33, "radial": 2}


def run(progress: Progress, *, every: int = 1) -> dict:
    """All figures, on every `every`-th of the rows, directions and steps; see the functions below."""
    return {
        **calculix_error(progress, every),
        **full_step(progress),
        **engine_control.reduced_model(progress, every),
        **engine_control.compensation(progress, every),
        **engine_control.extreme_targets(progress, every),
        **tet4_step(progress, every),
        **scaling(progress, every),
        **dynamics(progress),
    }


def calculix_error(progress: Progress, every: int = 1) -> dict:
    """`calculix_error_pct`: the worst tip error against every row of the table, in percent of the length."""
    worst = 0.0
    rows = stored_rows()[::every]
    for number, row in enumerate(rows, 1):
        progress(f"CalculiX, row {number} of {len(rows)}")
        gravity = -_GRAVITY * np.array([np.cos(row.inclination), 0.0, np.sin(row.inclination)])
        shape = Simulator(_reference_tube(row), reduced=False).solve(gravity)
        worst = max(worst, float(np.linalg.norm(shape.tip_position - [0.0, 0.0, REFERENCE["length"]] - row.tip)))
    return {"calculix_error_pct": round(100.0 * worst / REFERENCE["length"], 4)}


def full_step(progress: Progress) -> dict:
    """`full_step_ms`: one closed-loop step of the full model, median and p99."""
    progress("full model, closed loop")
    return {"full_step_ms": _statistics(closed_loop(Simulator(_article(), reduced=False), steps=400))}


def tet4_step(progress: Progress, every: int = 1) -> dict:
    """`tet4_step_ms`, the same loop on the article's kind of mesh, `speedup_over_tet4` of the full model over it in the same run,
    and the tips of both hanging horizontally, released: `tet4_sag_mm`, `full_sag_mm`.
    """
    progress("linear tetrahedra, the article's kind of mesh")
    robot = _article()
    baseline = Simulator(RobotModel(robot, tube_mesh(robot, "tet4", **_TET4)), reduced=False)
    full = Simulator(robot, reduced=False)
    sag = [s.solve([-_GRAVITY, 0.0, 0.0]).tip_position[0] for s in (baseline, full)]
    slow, fast = closed_loop(baseline, 60 // every, 50 // every), closed_loop(full, 200)
    return {
        "tet4_step_ms": _statistics(slow),
        "speedup_over_tet4": round(float(np.median(slow) / np.median(fast)), 1),
        "tet4_sag_mm": round(1e3 * float(sag[0]), 2),
        "full_sag_mm": round(1e3 * float(sag[1]), 2),
    }


def scaling(progress: Progress, every: int = 1) -> dict:
    """`scaling`: model step in ms over elements along the robot and over the number of cables, with the exponents."""
    robot = _article()
    along = {}
    for count in (10, 20, 40, 80)[: max(2, 4 // every)]:
        progress(f"scaling, {count} elements along the robot")
        finer = dataclasses.replace(robot, elements=dataclasses.replace(robot.elements, along=count))
        along[count] = _model_step(finer)
    cables = {}
    for count in (3, 6, 12, 24)[: max(2, 4 // every)]:
        progress(f"scaling, {count} cables")
        around = [dataclasses.replace(robot.cables[3], name=f"c{i}", angle=2.0 * np.pi * i / count) for i in range(count)]
        cables[count] = _model_step(dataclasses.replace(robot, cables=tuple(around)))
    return {
        "scaling": {
            "elements_along_ms": along,
            "elements_along_exponent": _exponent(along),
            "cables_ms": cables,
            "cables_exponent": _exponent(cables),
        }
    }


def dynamics(progress: Progress) -> dict:
    """The robot let go straight and horizontal, 0.6 s, worst tip against the full model at steps of 0.5 ms: `dynamics_error_mm` of
    the reduced model at 10 ms, `dynamics_full_error_mm` of the full one; `dynamics_step_ms` and `dynamics_full_step_ms`: one step.
    """
    model = RobotModel(_article())
    progress("dynamics, reference")
    reference, _ = _fall(DynamicSolver(model), model, 0.5e-3)
    progress("dynamics, 10 ms")
    figures = {}
    for name, solver in (("dynamics", engine_control.reduced_motion(model, progress)), ("dynamics_full", DynamicSolver(model))):
        coarse, times = _fall(solver, model, 10e-3)
        error = np.linalg.norm(coarse - reference[19::20], axis=1).max()
        figures |= {f"{name}_error_mm": round(1e3 * float(error), 3), f"{name}_step_ms": _statistics(times)}
    return figures


def closed_loop(simulator: Simulator, steps: int, warm_up: int = 50) -> np.ndarray:
    """(steps,) s that each closed-loop step takes, model and inverse problem, after `warm_up` steps more."""
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


def _fall(solver: DynamicSolver | ReducedDynamicSolver, model: RobotModel, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Tip positions (k, 3) of the robot let go straight and horizontal, its cables released, and what each step takes (k,) in s."""
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
    for _ in range(round(0.6 / h)):
        begin = time.perf_counter()
        motion = solver.step(gravity, CableInput(), h)
        times.append(time.perf_counter() - begin)
        if not motion.converged:
            raise ArithmeticError(f"a step of {1e3 * h:g} ms did not converge")
        tips.append(
            solver.model.tip(motion.q) if isinstance(motion, ReducedMotion) else model.effectors.sections(nodes + motion.u)[-1, 0]
        )
    return np.array(tips), np.array(times)


def _model_step(robot: Robot) -> float:
    """Median ms of the model's step while gravity turns and every third cable is taut."""
    simulator = Simulator(robot, reduced=False)
    tension = np.where(np.arange(len(robot.cables)) % 3 == 0, 0.2 * 3 / len(robot.cables), 0.0)
    simulator.solve([-_GRAVITY, 0.0, 0.0], tension=tension)
    times = []
    for step in range(30):
        angle = _TURN * step / _RATE
        gravity = -_GRAVITY * np.array([np.cos(angle), 0.0, np.sin(angle)])
        times.append(simulator.step(gravity, tension=tension).solve_time)
    return round(1e3 * float(np.median(times)), 3)


def _exponent(times: dict[int, float]) -> float:
    """Slope of log time over log size."""
    return round(float(np.polyfit(np.log(list(times)), np.log(list(times.values())), 1)[0]), 3)


def _statistics(times: np.ndarray) -> dict:
    return {"median": round(1e3 * float(np.median(times)), 3), "p99": round(1e3 * float(np.percentile(times, 99)), 3)}


def _reference_tube(row: Row) -> Robot:
    """The tube that CalculiX computed, without cables."""
    article = _article()
    segments = tuple(
        dataclasses.replace(s, outer_diameter=REFERENCE["outer_diameter"], lumen_diameter=REFERENCE["inner_diameter"])
        for s in article.segments
    )
    return dataclasses.replace(article, segments=segments, cables=()).with_material(
        law={"svk": "svk", "nh": "neo_hookean"}[row.law],
        youngs_modulus=row.youngs_modulus,
        poissons_ratio=row.poissons_ratio,
        density=REFERENCE["density"],
    )


def _article() -> Robot:
    return load_robot_file("article").robot
