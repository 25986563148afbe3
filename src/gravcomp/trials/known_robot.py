"""Check of the calibration: virtual robots with known parameters, and the parameters fitted to their tip positions."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.fit import StaticFit, fit_statics
from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.motion import EVALUATIONS, fit_motion
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import Robot
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.trials.context import Context
from gravcomp.trials.free_fall import BRIEF_EVALUATIONS, BRIEF_FALL, FALL, free_fall
from gravcomp.trials.tracker import Tracker
from gravcomp.virtual.body import build_rod
from gravcomp.virtual.equilibrium import equilibrium
from gravcomp.virtual.motion import base_orientation

MODULI = (0.69, 0.94, 1.31)  # of the described modulus
_DAMPING = 0.09  # damping time over the robot's first period: a damping ratio of 0.28
_OFFSETS = (3e-3, -2e-3, 1e-3, -1.5e-3, 2.5e-3, 0.5e-3)  # of the robot's length, one cable after another
# Of the length: each cable in turn is pulled in by these; two tensions are needed to distinguish an offset from an elongation.
_PULLS = (6e-3, 18e-3)
_RELEASED = -0.3  # of the length
_POSES = ((0.0, 0.0), (0.0, 90.0), (-45.0, 45.0))  # inclination, roll, deg, of the robot at rest
_FITTED = {"offsets", "compliance", "winding"}
_IMAGES = 100  # that are averaged, as of a camera in some seconds: the direction is then known to 0.05 degrees


@dataclass(frozen=True)
class Recovered:
    """A parameter with its true value, the fitted value and half the width of its 95 % interval."""

    name: str
    unit: str
    true: float
    fitted: float
    interval: float

    @property
    def error(self) -> float:
        """Relative error of the fitted value."""
        return abs(self.fitted / self.true - 1.0)


def recover(context: Context) -> list[Recovered]:
    """Fit modulus, offsets and elasticity to tips at rest, modulus and damping to free falls. Returns true and fitted values."""
    described = context.setup.robot.materials[0].youngs_modulus
    moduli = [ratio * described for ratio in (MODULI[1:2] if context.brief else MODULI)]
    poses = _POSES[:1] if context.brief else _POSES
    pulls = _PULLS[1:] if context.brief else _PULLS
    jobs = [(context.setup, modulus, poses, pulls) for modulus in moduli]
    fits = context.map(_fit_known, jobs, "fitting robots with known parameters")
    found = []
    for modulus, fit in zip(moduli, fits):
        found += [
            Recovered(f"{e.name}, at rest", "MPa", modulus * 1e-6, e.value, e.interval)
            for e in fit.estimates[: len(context.setup.robot.materials)]
        ]
    for estimate in fits[0].estimates:
        cable = next((i for i, c in enumerate(context.setup.robot.cables) if estimate.name == f"offset of {c.name}"), None)
        if cable is not None:
            found.append(
                Recovered(estimate.name, "mm", 1e3 * offsets(context.setup.robot)[cable], estimate.value, estimate.interval)
            )
    setup = known_setup(context.setup, moduli[0])
    inclinations, periods = ((0.0,), BRIEF_FALL) if context.brief else ((0.0, 30.0), FALL)
    duration = periods * context.setup.first_period
    falls = context.map(
        free_fall, [(setup, i, 0.0, duration, trial) for trial, i in enumerate(inclinations)], "free falls of the known robot"
    )
    motion = fit_motion(
        context.setup.robot,
        falls,
        mapper=context.sweep.map,
        progress=lambda s: context.progress(f"fall of the known robot: {s}"),
        creep=False,
        evaluations=BRIEF_EVALUATIONS if context.brief else EVALUATIONS,
    )
    found.append(
        Recovered(
            "Young's modulus, in motion", "MPa", moduli[0] * 1e-6, motion.youngs_modulus * 1e-6, motion.modulus_interval * 1e-6
        )
    )
    true = 1e3 * damping_time(context.setup)
    found.append(Recovered("damping time", "ms", true, 1e3 * motion.damping_time, 1e3 * motion.damping_interval))
    return found


def damping_time(setup: Setup) -> float:
    """Return the damping time in s of the known robot."""
    return _DAMPING * setup.first_period


def offsets(robot: Robot) -> np.ndarray:
    """Return the offsets (m,) in m of the known robot's cables."""
    return robot.length * np.resize(_OFFSETS, len(robot.cables))


def known_setup(setup: Setup, modulus: float) -> Setup:
    """Return a virtual robot with the model's material law and this module's parameters, without creep and friction."""
    material, truth = setup.robot.materials[0], setup.truth
    body = dataclasses.replace(
        truth.body, youngs_modulus=modulus, poissons_ratio=material.poissons_ratio, density=material.density, creep_ratio=(0.0,),
        creep_time=(1.0,), damping_time=damping_time(setup), slip_ratio=0.0,
    )  # fmt: skip
    tendons = dataclasses.replace(truth.tendons, radius_offset=0.0, angle_offset=0.0, friction=0.0)
    return dataclasses.replace(setup, truth=dataclasses.replace(truth, body=body, tendons=tendons))


def known_windows(
    setup: Setup, poses: tuple[tuple[float, float], ...] = _POSES, pulls: tuple[float, ...] = _PULLS
) -> StillWindows:
    """Return tips at rest of the known robot: released, and with each cable pulled in, in each pose (inclination, roll, deg).

    pulls: of each cable, over the length.
    """
    rod, random = build_rod(setup.true_robot), np.random.default_rng(setup.seed)
    count, rows = rod.tendons, []
    length, offset = setup.nominal.length, offsets(setup.nominal)
    for inclination, roll in poses:
        gravity = base_orientation(np.radians(inclination), np.radians(roll)).T @ np.array([0.0, 0.0, -STANDARD_GRAVITY])
        commands = [np.full(count, np.nan)] + [
            np.where(np.arange(count) == c, length * pull, np.nan) for c in range(count) for pull in pulls
        ]
        for command in commands:
            # A released cable is slack.
            displacement = np.where(np.isnan(command), _RELEASED * length, command + offset)
            shape = equilibrium(rod, gravity, displacement=displacement)
            tips, directions = (np.tile(value, (_IMAGES, 1)) for value in (shape.tip, shape.orientation[-1, :, 2]))
            tip, direction = Tracker().seen(length, tips, directions, random)
            rows.append((gravity, command, tip.mean(axis=0), direction.mean(axis=0)))
    gravity, displacement, tip, direction = (np.array(column) for column in zip(*rows))
    return StillWindows(gravity, displacement, tip, direction)


def _fit_known(job: tuple[Setup, float, tuple[tuple[float, float], ...], tuple[float, ...]]) -> StaticFit:
    setup, modulus, poses, pulls = job
    return fit_statics(setup.robot, known_windows(known_setup(setup, modulus), poses, pulls), groups=_FITTED)
