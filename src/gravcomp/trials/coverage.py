"""How often the intervals of a calibration contain the truth: many drawn robots in the poses of one plan.

Each seed draws true parameters around the description, in the ranges of `virtual.draw`; the tips that they give, by the model
linearised at the description, with noise and with a stiffness that the model lacks, are fitted like measured ones. True bodies
creep by the branches of their material's class, with other times; the fit has those of the plan. It covers plan, priors, choice
of what is fitted, and intervals; not the difference of mechanical models, for which `bench robots --loop` measures whole virtual
robots.

All seeds of a robot share one linearised model: a seed costs the least squares only.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.approach import as_pulled
from gravcomp.calibration.estimates import edge_unit
from gravcomp.calibration.fit import TipNoise, body_mass, fit_statics
from gravcomp.calibration.measured import History, Start, StillWindows
from gravcomp.calibration.parameters import StaticParameters, creep_in_branches, starting_parameters
from gravcomp.calibration.plan import Plan, creep_times
from gravcomp.calibration.planning import make_plan
from gravcomp.calibration.statics import StaticPrediction, StaticPredictor
from gravcomp.calibration.unknowns import GROUPS
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import Robot, load_robot_file
from gravcomp.full_model.modes import first_period
from gravcomp.materials.material_classes import class_of
from gravcomp.mesh.coarse import with_coarse_elements

_KINDS = {"modulus"} | {kind for kinds in GROUPS.values() for kind in kinds}
_EVEN = {
    "modulus": 0.08,
    "density": 0.02,
    "radius": 0.01,
    "angle": np.radians(1.0),
    "winding": 0.003,
    "mount": np.radians(0.5),
    "bias": 0.08,
}
"""Half widths of the even distributions of what is drawn, in the units of `StaticParameters`; the modulus in its logarithm."""

_LINE, _ZERO, _FRICTION = 0.1, 2e-3, 0.1  # stretch, relative; zero of a cable, over the length; coefficient of friction
_CREEP = 0.3  # of the ratios of a class, and of its friction, relative
_TIMES = (0.5, 1.0, 2.0)  # factors of the times of a class, of which each branch has one
_WINDOWS = 3  # of each rest
_FIRST = 0.1  # of a rest: the beginning of its first window
_COUNTED = 0.4  # of the seeds: kinds with fewer intervals count together, as RARE

RARE = "rarely told"
"""Kind that stands for all that only few of the seeds tell: no share follows from two or three intervals."""


@dataclass(frozen=True)
class Covered:
    """One kind of parameter: share of intervals with the truth in them, mean half width over the errors' deviation, and count."""

    share: float
    width: float
    count: int


def coverage(robot: Robot, plan: Plan, seeds: Sequence[int]) -> dict[str, Covered]:
    """Return for each kind of parameter how its intervals cover the truth over the seeds; kinds never seen are left out.

    Raises MeshError, RuntimeError where a pose has no equilibrium.
    """
    noise = TipNoise()
    robot = with_coarse_elements(robot)
    linear = _Linear(robot, plan)
    body, payload, rest = body_mass(robot)
    errors: dict[str, list[float]] = {}
    halves: dict[str, list[float]] = {}
    for seed in seeds:
        random = np.random.default_rng(seed)
        true, branches = drawn(robot, random), _drawn_branches(robot, random)
        tip = linear.tips(_lacking(true, noise, random), branches)
        # One error of the model for all windows of a rest.
        error = random.standard_normal((len(plan.poses), 6)) * np.repeat(
            [noise.position_share * robot.length, noise.direction], 3
        )
        linear.measure(tip + np.repeat(error, _WINDOWS, axis=0))
        mass = (true.density * body + true.payload * payload + rest) * (1.0 + noise.balance * random.standard_normal())
        fit = fit_statics(robot, linear.windows, mass=mass, creep_times=linear.times, noise=noise, predictor=linear)
        for estimate in fit.estimates:
            if estimate.seen:
                _, factor = edge_unit(estimate.kind)
                values = linear.told(branches) if estimate.kind == "creep" else true.values(estimate.kind)
                scale = (
                    abs(estimate.initial) or 1.0 if estimate.kind in ("modulus", "compliance") else 1.0
                )  # MPa of soft and stiff
                errors.setdefault(estimate.kind, []).append((estimate.value - factor * float(values[estimate.index])) / scale)
                halves.setdefault(estimate.kind, []).append(estimate.interval / scale)
    return counted(errors, halves, len(seeds))


def counted(errors: dict[str, list[float]], halves: dict[str, list[float]], seeds: int) -> dict[str, Covered]:
    """Return the kinds with their shares; those that few seeds tell together, in deviations of their intervals."""
    found: dict[str, Covered] = {}
    rare_error: list[float] = []
    for kind, own in errors.items():
        error, half = np.array(own), np.array(halves[kind])
        if len(error) < max(3.0, _COUNTED * seeds):
            rare_error += list(error / half)
            continue
        found[kind] = _covered(error, half)
    if len(rare_error) >= max(3.0, _COUNTED * seeds):
        found[RARE] = _covered(np.array(rare_error), np.ones(len(rare_error)))
    return found


def _covered(error: np.ndarray, half: np.ndarray) -> Covered:
    """Return how half widths (k,) cover errors (k,), whose deviation is that from the truth."""
    return Covered(float(np.mean(np.abs(error) <= half)), float(half.mean() / np.sqrt(np.mean(error**2))), len(error))


def drawn(robot: Robot, random: np.random.Generator) -> StaticParameters:
    """Return true parameters around the described ones."""
    found = starting_parameters(robot, ())
    for kind, half in _EVEN.items():
        for index in range(found.count(kind)):
            found = found.changed(kind, (index,), float(random.uniform(-half, half)))
    count = len(robot.cables)
    for cable in range(count):
        found = found.changed("offset", (cable,), float(_ZERO * robot.length * random.uniform(-1.0, 1.0)))
    stretch = 1.0 + _LINE * random.uniform(-1.0, 1.0)  # of one maker's line for all
    for cable in range(count):
        found = found.changed("compliance", (cable,), float((stretch - 1.0) * found.compliance[cable]))
    usual = class_of(robot.materials[0].youngs_modulus)
    found = found.changed("slip", (0,), float(usual.slip * (1.0 + _CREEP * random.uniform(-1.0, 1.0))))
    return found.changed("friction", (0,), float(_FRICTION * random.uniform(0.0, 1.0)))


def _lacking(true: StaticParameters, noise: TipNoise, random: np.random.Generator) -> StaticParameters:
    """Return the parameters with the stiffness that the robot shows beyond its lasting modulus."""
    for index in range(true.count("modulus")):
        true = true.changed("modulus", (index,), float(noise.stiffness * random.standard_normal()))
    return true


def _true_times(robot: Robot) -> np.ndarray:
    """Return the times (b,) in s of all branches that true bodies may have, each of its class with all factors."""
    return np.outer(class_of(robot.materials[0].youngs_modulus).creep_time, _TIMES).ravel()


def _drawn_branches(robot: Robot, random: np.random.Generator) -> np.ndarray:
    """Return the ratios (b,) of the branches of `_true_times`: each of the class of the first material has one of its times."""
    ratio = np.array(class_of(robot.materials[0].youngs_modulus).creep_ratio)
    factors = np.zeros((len(ratio), len(_TIMES)))
    factors[np.arange(len(ratio)), random.integers(len(_TIMES), size=len(ratio))] = 1.0
    return (ratio[:, None] * factors * (1.0 + _CREEP * random.uniform(-1.0, 1.0))).ravel()


class _Linear:
    """The model of a robot in the windows of a plan, linearised at the description without creep.

    windows: what was measured last; times: of the branches of creep that are fitted, in s.
    """

    def __init__(self, robot: Robot, plan: Plan):
        self.times = creep_times(plan.rest)
        self._true_times = _true_times(robot)
        self.windows = _windows(plan)
        # The fit's branches, and after them the true ones.
        predictor = StaticPredictor(robot, self.windows, (*self.times, *self._true_times))
        start = starting_parameters(robot, (*self.times, *self._true_times))
        self._start = dataclasses.replace(start, creep=np.zeros_like(start.creep))
        self._here = predictor.predict(self._start)
        self._slopes = predictor.differentiate(self._start, _KINDS)

    def measure(self, tip: np.ndarray) -> None:
        """Set the measured tips (k, 6) of the windows."""
        self.windows = dataclasses.replace(self.windows, tip_position=tip[:, :3], tip_direction=tip[:, 3:])

    def tips(self, parameters: StaticParameters, branches: np.ndarray) -> np.ndarray:
        """Return the tips (k, 6) of a body with these parameters, without their creep, and true branches (b,)."""
        return self.predict(parameters).tip + self._slopes["creep"][:, :, len(self.times) :] @ branches

    def told(self, branches: np.ndarray) -> np.ndarray:
        """Return what true branches (b,) are in those of the fit."""
        return creep_in_branches(branches.tolist(), self._true_times.tolist(), self.times)

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the tips at the parameters, to first order; of their creep by the branches that are fitted."""
        tip = self._here.tip.copy()
        for kind, slopes in self._slopes.items():
            there = parameters.values(kind)
            start = self._start.values(kind)[: len(there)]
            tip += slopes[:, :, : len(there)] @ (np.log(there / start) if kind == "modulus" else there - start)
        return StaticPrediction(tip, self._here.tension)

    def differentiate(self, parameters: StaticParameters, kinds: set[str]) -> dict[str, np.ndarray]:
        """Return the derivatives at the description."""
        return self._slopes


def _windows(plan: Plan) -> StillWindows:
    """Return the windows of the plan's rests, whose tips are not measured yet."""
    ends = np.cumsum(plan.times)
    edges = np.geomspace(_FIRST * plan.rest, plan.rest, _WINDOWS + 1)
    middles = (ends - plan.rest)[:, None] + 0.5 * (edges[:-1] + edges[1:])
    each = np.repeat(np.arange(len(plan.poses)), _WINDOWS)
    gravity = np.array([plan.poses[k].gravity for k in each])
    displacement = np.array([plan.poses[k].displacement for k in each])
    start = Start(0.0, gravity[0], displacement[0])
    return StillWindows(
        gravity,
        displacement,
        np.zeros((len(each), 3)),
        np.zeros((len(each), 3)),
        History(np.zeros(len(each), int), (ends - plan.rest)[each], middles.ravel(), {0: start}),
        np.full(len(each), 1.0 / _WINDOWS),
    )


def coverage_of_robots(
    files: Sequence[str], seeds: Sequence[int], progress: Callable[[str], None]
) -> dict[str, dict[str, Covered]]:
    """Return the coverage of robots, each in its own plan. Raises ConfigError, MeshError."""
    found = {}
    for file in files:
        setup = Setup.of(load_robot_file(file))
        robot = as_pulled(setup.robot, setup.hardware)
        inverse = setup.controller.inverse
        plan = make_plan(robot, first_period(robot), setup.hardware.transmission, progress=progress, inverse=inverse)
        progress(f"{robot.name}: coverage over {len(seeds)} seeds")
        found[robot.name] = coverage(robot, plan, seeds)
    return found
