"""Reduced model and inverse problem: cost of a closed-loop step, error against the full model, error after compensation."""

import itertools
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from gravcomp.description import Robot, load_robot_file
from gravcomp.inverse import Command, InverseController, Target, bend_target, direction_weight, straight_target
from gravcomp.mesh.coarse import with_coarse_elements
from gravcomp.reduction import load
from gravcomp.reduction.motion import ReducedDynamicSolver
from gravcomp.simulation import RobotModel, Shape, Simulator
from gravcomp.training import build

Progress = Callable[[str], None]

_GRAVITY, _RATE = 9.81, 100.0  # m/s^2, steps per second
_DIRECTIONS, _SETTLING = 200, 80
_STEPS, _LEAST_STEPS = 400, 100  # of a path; the first 50 are not timed


def reduced_model(progress: Progress, every: int = 1, law: str = "svk") -> dict:
    """Return the figures of the reduced model in the closed loop, for the article's robot of a material law.

    `reduction_build_s`: time to build it (0: it existed); `reduced_step_ms`: one closed-loop step, and `inverse_us`: the
    inverse problem, both while gravity turns about random axes at 10 deg/s; `reduced_error_mm`: worst tip error against the
    full model with the same commands, at 10 and 90 deg/s; `reduced_share`: share of the steps computed with the reduced model.
    every > 1: of a coarse mesh where the reduced model is not stored.
    """
    robot = load_robot_file("article").robot.with_material(law=law)
    model = RobotModel(robot)
    if every > 1 and load(model) is None:
        model = RobotModel(with_coarse_elements(robot))  # to build it takes a part of the time
    seconds = _build_if_needed(model, progress)
    return {"reduction_build_s": round(seconds, 1), **reduced_figures(model, progress, every)}


def reduced_figures(model: RobotModel, progress: Progress, every: int = 1) -> dict:
    """Return the figures of `reduced_model`, without the time of the build, for a robot whose reduced model is built."""
    robot = model.robot
    target = straight_target(robot.length, tip_direction_weight=direction_weight(robot.length))
    steps, solves, served = [], [], []
    errors: dict[int, float] = {}
    for rate in (10, 90):
        for seed in range(0, 3, every):
            progress(f"reduced model at {rate} deg/s, path {seed + 1} of 3")
            gravities = random_path(np.radians(rate), max(_LEAST_STEPS, _STEPS // every), seed)
            loop = list(closed_loop(Simulator(model), gravities, target))
            if rate == 10:
                steps += [shape.solve_time + command.solve_time for shape, command in loop[50:]]
                solves += [command.solve_time for _, command in loop[50:]]
            served += [shape.model == "reduced" for shape, _ in loop]
            errors[rate] = max(errors.get(rate, 0.0), _worst_error(robot, gravities, loop))
    return {
        "reduced_step_ms": _statistics(np.array(steps), 1e3),
        "inverse_us": _statistics(np.array(solves), 1e6),
        "reduced_error_mm": round(1e3 * max(errors.values()), 4),
        "reduced_error_by_rate_mm": {f"{rate} deg/s": round(1e3 * error, 4) for rate, error in errors.items()},
        "reduced_share": round(float(np.mean(served)), 4),
    }


def reduced_motion(model: RobotModel, progress: Progress) -> ReducedDynamicSolver:
    """Return the dynamic solver of the reduced model."""
    _build_if_needed(model, progress)
    reduction = load(model)
    assert reduction is not None  # it has just been built
    reduced = reduction.reduced_model(model)
    mass = reduced.basis.T @ model.mass_matrix().multiply(reduced.basis)
    return ReducedDynamicSolver(reduced, mass, model.mesh.materials[0].damping_time, model.length)


def compensation(progress: Progress, every: int = 1) -> dict:
    """Return the errors of the full model with the computed displacements, over random directions of gravity.

    `inverse_lateral_mm`: without a weight on the tip direction; `inverse_tilt_deg`, `inverse_lateral_with_direction_mm`: with it;
    `inverse_shortening_mm`: remaining axial error; `inverse_least_tension_n`: the smallest tension of a segment, largest over the
    directions, which shows cables that pull against each other.
    """
    robot = load_robot_file("article").robot
    simulator, full = Simulator(robot), Simulator(robot, reduced=False)
    lateral: list[float] = []
    lateral_tilted: list[float] = []
    tilt, shortening, least = [], [], []
    for number, gravity in list(enumerate(_directions(_DIRECTIONS)))[::every]:
        progress(f"compensation, direction {number + 1} of {_DIRECTIONS}")
        for weight in (0.0, direction_weight(robot.length)):
            target = straight_target(robot.length, tip_direction_weight=weight)
            *_, (_, command) = closed_loop(simulator, [gravity] * _SETTLING, target)
            shape = full.step(gravity, command.displacement)
            (lateral_tilted if weight else lateral).append(float(np.linalg.norm(shape.tip_position[:2])))
            if weight:
                tilt.append(np.degrees(np.arctan2(np.linalg.norm(shape.tip_direction[:2]), shape.tip_direction[2])))
                shortening.append(robot.length - shape.tip_position[2])
                least.append(max(_tensions_of(robot, segment.name, shape).min() for segment in robot.segments))
    return {
        "inverse_lateral_mm": _spread(lateral, 1e3),
        "inverse_lateral_with_direction_mm": _spread(lateral_tilted, 1e3),
        "inverse_tilt_deg": _spread(tilt, 1.0),
        "inverse_shortening_mm": _spread(shortening, 1e3),
        "inverse_least_tension_n": round(max(least), 4),
    }


def extreme_targets(progress: Progress, every: int = 1) -> dict:
    """Return the figures of unreachable targets and very large bends, each for 6 s (over `every`), then of the straight one.

    `extreme_step_ms`: the longest step of the model; `extreme_back_mm`: worst final distance of the tip from its position in a
    run with the straight target only.
    """
    robot = load_robot_file("article").robot
    simulator, straight = Simulator(robot), straight_target(robot.length, tip_direction_weight=direction_weight(robot.length))
    targets = [bend_target(robot.length, angle, 0.7 * k) for k, angle in enumerate((2.6, 3.5, 4.5, 5.5, 6.2))]
    targets += [
        Target(robot.length * np.array(tip)) for tip in ([0.0, 0.0, 0.0], [0.0, 0.2, -0.5], [0.9, 0.0, 0.0], [0.0, 0.0, 1.4])
    ]
    longest, distances, steps = 0.0, [], int(6 * _RATE) // every
    for number, target in list(enumerate(targets))[::every]:
        for gravity in _GRAVITY * np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]):
            progress(f"extreme targets, {number + 1} of {len(targets)}")
            *_, (held, _) = closed_loop(simulator, [gravity] * steps, straight)
            loop = list(closed_loop(simulator, [gravity] * (2 * steps), [target] * steps + [straight] * steps))
            longest = max(longest, max(shape.solve_time for shape, _ in loop))
            distances.append(np.linalg.norm(loop[-1][0].tip_position - held.tip_position))
    return {"extreme_step_ms": round(1e3 * longest, 1), "extreme_back_mm": round(1e3 * float(max(distances)), 3)}


def closed_loop(
    simulator: Simulator, gravities: Iterable[np.ndarray], target: Target | list[Target]
) -> Iterator[tuple[Shape, Command]]:
    """Yield shape and command of each step, starting with the released robot; target: one, or one per step."""
    targets = itertools.repeat(target) if isinstance(target, Target) else target
    controller = InverseController(simulator.robot)
    simulator.reset()
    displacement = None
    for gravity, wanted in zip(gravities, targets):
        shape = simulator.step(gravity, displacement)
        command = controller.step(
            shape.response,
            wanted,
            backbone_station=shape.backbone_station,
            tension=shape.cable_tension,
            interval=1.0 / _RATE,
            followed=shape.is_equilibrium,
        )
        displacement = command.displacement
        yield shape, command


def _build_if_needed(model: RobotModel, progress: Progress) -> float:
    """Build the reduced model if there is none; return the time in s, or 0."""
    if load(model) is not None:
        return 0.0
    progress("building the reduced model")
    return build(model)[1]


def random_path(rate: float, steps: int, seed: int) -> np.ndarray:
    """Return gravity (steps, 3) in m/s^2 that turns at `rate` (rad/s) about a random axis, which changes every second."""
    rng = np.random.default_rng(seed)
    gravity = _GRAVITY * _unit(rng)
    path = []
    for step in range(steps):
        if step % round(_RATE) == 0:
            axis = _unit(rng)
        angle = rate / _RATE
        along = axis * (axis @ gravity)
        gravity = along + np.cos(angle) * (gravity - along) + np.sin(angle) * np.cross(axis, gravity)
        path.append(gravity)
    return np.array(path)


def _worst_error(robot: Robot, gravities: np.ndarray, loop: list[tuple[Shape, Command]]) -> float:
    """Return the worst distance (m) of the loop's tips from those of the full model with the same displacements."""
    full = Simulator(robot, reduced=False)
    displacement, worst = None, 0.0
    for gravity, (shape, command) in zip(gravities, loop):
        exact = full.step(gravity, displacement)
        worst = max(worst, float(np.linalg.norm(exact.tip_position - shape.tip_position)))
        displacement = command.displacement
    return worst


def _tensions_of(robot: Robot, segment: str, shape: Shape) -> np.ndarray:
    return shape.cable_tension[[cable.segment == segment for cable in robot.cables]]


def _directions(count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.array([_GRAVITY * _unit(rng) for _ in range(count)])


def _unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def _statistics(values: np.ndarray, factor: float) -> dict:
    return {"median": round(factor * float(np.median(values)), 3), "p99": round(factor * float(np.percentile(values, 99)), 3)}


def _spread(values: list[float], factor: float) -> dict:
    return {"median": round(factor * float(np.median(values)), 4), "worst": round(factor * float(np.max(values)), 4)}
