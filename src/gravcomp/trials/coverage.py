"""How often the intervals of a calibration contain the truth: many drawn robots in the poses of one plan.

Each seed draws true parameters around the description, in the ranges of `virtual.draw`; the tips that they give, by the model
linearised at the description, with noise and with a stiffness that the model lacks, are fitted like measured ones. It covers
plan, priors, choice of what is fitted, and intervals; not the difference of mechanical models, for which `bench robots --loop`
measures whole virtual robots.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.estimates import edge_unit
from gravcomp.calibration.fit import TipNoise, body_mass, fit_statics
from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.parameters import StaticParameters, starting_parameters
from gravcomp.calibration.plan import PlannedPose, make_plan
from gravcomp.calibration.statics import StaticPrediction, StaticPredictor
from gravcomp.calibration.unknowns import GROUPS
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import Robot, load_robot_file
from gravcomp.full_model.modes import first_period
from gravcomp.mesh.tube import with_coarse_elements

_GROUPS = set(GROUPS) - {"creep"}  # of poses without a history
_KINDS = {"modulus"} | {kind for name in _GROUPS for kind in GROUPS[name]}
_EVEN = {"modulus": 0.08, "density": 0.02, "radius": 0.01, "angle": np.radians(1.0), "winding": 0.003, "mount": np.radians(0.5)}
"""Half widths of the even distributions of what is drawn, in the units of `StaticParameters`; the modulus in its logarithm."""

_LINE, _ZERO, _FRICTION = 0.1, 2e-3, 0.1  # stretch, relative; zero of a cable, over the length; coefficient of friction


@dataclass(frozen=True)
class Covered:
    """One kind of parameter: share of intervals with the truth in them, mean half width over the errors' deviation, and count."""

    share: float
    width: float
    count: int


def coverage(robot: Robot, poses: Sequence[PlannedPose], seeds: Sequence[int]) -> dict[str, Covered]:
    """Return for each kind of parameter how its intervals cover the truth over the seeds; kinds never seen are left out.

    Raises MeshError, RuntimeError where a pose has no equilibrium.
    """
    noise = TipNoise()
    robot = with_coarse_elements(robot)
    linear = _Linear(robot, poses)
    body, payload, rest = body_mass(robot)
    errors: dict[str, list[float]] = {}
    halves: dict[str, list[float]] = {}
    for seed in seeds:
        random = np.random.default_rng(seed)
        true = drawn(robot, random)
        tip = linear.predict(_lacking(true, noise, random)).tip
        tip = tip + random.standard_normal(tip.shape) * np.repeat([noise.position_share * robot.length, noise.direction], 3)
        linear.windows = StillWindows(linear.windows.gravity, linear.windows.displacement, tip[:, :3], tip[:, 3:])
        mass = (true.density * body + true.payload * payload + rest) * (1.0 + noise.balance * random.standard_normal())
        fit = fit_statics(robot, linear.windows, groups=_GROUPS, mass=mass, noise=noise, predictor=linear)
        for estimate in fit.estimates:
            if estimate.seen:
                _, factor = edge_unit(estimate.kind)
                error = estimate.value - factor * float(true.values(estimate.kind)[estimate.index])
                errors.setdefault(estimate.kind, []).append(error)
                halves.setdefault(estimate.kind, []).append(estimate.interval)
    return {
        kind: Covered(float(np.mean(np.abs(found) <= halves[kind])), float(np.mean(halves[kind]) / np.std(found)), len(found))
        for kind, found in errors.items()
    }


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
    return found.changed("friction", (0,), float(_FRICTION * random.uniform(0.0, 1.0)))


def _lacking(true: StaticParameters, noise: TipNoise, random: np.random.Generator) -> StaticParameters:
    """Return the parameters with the stiffness that the robot shows beyond its lasting modulus."""
    for index in range(true.count("modulus")):
        true = true.changed("modulus", (index,), float(noise.stiffness * random.standard_normal()))
    return true


class _Linear:
    """The model of a robot in the poses, linearised at the description."""

    def __init__(self, robot: Robot, poses: Sequence[PlannedPose]):
        displacement = np.array([pose.displacement for pose in poses])
        self.windows = StillWindows(
            np.array([pose.gravity for pose in poses]), displacement, np.zeros((len(poses), 3)), np.zeros((len(poses), 3))
        )
        predictor, self._start = StaticPredictor(robot, self.windows), starting_parameters(robot, ())
        self._here = predictor.predict(self._start)
        self._slopes = predictor.differentiate(self._start, _KINDS)

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        """Return the tips at the parameters, to first order."""
        tip = self._here.tip.copy()
        for kind, slopes in self._slopes.items():
            there, start = parameters.values(kind), self._start.values(kind)
            tip += slopes @ (np.log(there / start) if kind == "modulus" else there - start)
        return StaticPrediction(tip, self._here.tension)

    def differentiate(self, parameters: StaticParameters, kinds: set[str]) -> dict[str, np.ndarray]:
        """Return the derivatives at the description."""
        return self._slopes


def coverage_of_robots(
    files: Sequence[str], seeds: Sequence[int], progress: Callable[[str], None]
) -> dict[str, dict[str, Covered]]:
    """Return the coverage of robots, each in its own plan. Raises ConfigError, MeshError."""
    found = {}
    for file in files:
        setup = Setup.of(load_robot_file(file))
        robot = setup.robot
        plan = make_plan(robot, first_period(robot), setup.hardware.transmission, progress=progress)
        progress(f"{robot.name}: coverage over {len(seeds)} seeds")
        found[robot.name] = coverage(robot, plan.poses, seeds)
    return found
