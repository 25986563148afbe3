"""The poses that a calibration may measure: those in which the limits let the robot be, and which show in a measured tip.

In each of some orientations of the base: the robot with its cables released, with one cable under a tension that the limits
allow, and with the cables that hold it in its shape at rest (`held_pose`).
"""

import math
from collections.abc import Callable

import numpy as np

from gravcomp.calibration.fit import TipNoise
from gravcomp.calibration.held_pose import held_at_rest
from gravcomp.calibration.plan import PlannedPose, PlanOptions, gravity_of
from gravcomp.calibration.unknowns import Priors
from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.description.transmission import Transmission
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.inverse import InverseOptions
from gravcomp.simulation import Shape, Simulator

_LEVELS = (0.35, 1.0)  # of the largest tension that is used: two are needed to distinguish an offset from a stretch
_FARTHER = 1.5  # than the linear model expects, a tip may turn
_TO_WIND = 0.25  # of a pose's time: at most that much is for slack that is wound in
_SURE = 2.0  # deviations of a cable's zero

ORIENTATIONS = tuple(
    (math.radians(inclination), math.radians(roll))
    for inclination, rolls in ((0.0, range(0, 360, 60)), (45.0, range(30, 360, 120)), (-45.0, range(90, 450, 120)))
    for roll in rolls
)
"""Inclination and roll of the candidates in rad."""


def pose_candidates(
    robot: Robot,
    transmission: Transmission | None,
    options: PlanOptions,
    noise: TipNoise,
    progress: Callable[[str], None],
    orientations: tuple[tuple[float, float], ...],
    inverse: InverseOptions | None,
) -> tuple[list[PlannedPose], list[bool], list[Equilibrium]]:
    """Return the poses that the limits allow, whether each is measured at every station, and their shapes.

    Raises ConfigError where no pull that they allow shows in a measured tip.
    """
    simulator = Simulator(robot, reduced=False)
    found: list[tuple[PlannedPose, bool, Equilibrium]] = []
    moves: list[tuple[float, float]] = []
    count = len(robot.cables)
    slack = _slack(robot, options)
    for number, (inclination, roll) in enumerate(orientations):
        progress(f"planning: orientation {number + 1} of {len(orientations)}")
        gravity = gravity_of(inclination, roll)
        free = simulator.solve(gravity)
        if not free.is_equilibrium:
            continue
        released = _pose(robot, inclination, roll, free, np.zeros(count), slack, transmission)
        found.append((released, True, simulator.solver.state))
        largest = _largest_tension(robot, free, options)
        moves += [(0.0, 0.0)] * int((largest == 0.0).sum())
        for one in np.eye(count)[largest > 0.0]:
            for level in _LEVELS:
                tension = level * largest * one
                shape = simulator.solve(gravity, tension=tension)
                if not shape.is_equilibrium:
                    continue
                moves.append((float(np.linalg.norm(shape.tip_position - free.tip_position)), _turned(shape, free)))
                if moves[-1][1] <= _FARTHER * options.bend:
                    pose = _pose(robot, inclination, roll, shape, tension, slack, transmission)
                    found.append((pose, False, simulator.solver.state))
        held = None if inverse is None or not count else held_at_rest(simulator, robot, transmission, inverse, gravity)
        strongest = 0.0 if held is None else float(held.cable_tension.max(initial=0.0))
        if held is not None and 0.0 < strongest <= options.tension * robot.limits.tension_max:
            pose = _pose(robot, inclination, roll, held, held.cable_tension, slack, transmission)
            found.append((pose, True, simulator.solver.state))
    if moves:
        _refuse_unseen(np.array(moves), robot, options, noise)
    found = [entry for entry in found if entry[0].displacement.max(initial=0.0) <= robot.limits.displacement_max]
    poses, usual, shapes = zip(*found) if found else ((), (), ())
    return list(poses), list(usual), list(shapes)


def _slack(robot: Robot, options: PlanOptions) -> float:
    """Return by how much in m a released cable is longer than its path.

    Where motors wind in slowly, less than `options.slack`, but no less than the zero of a cable may be wrong by.
    """
    wound = _TO_WIND * options.budget / options.most * robot.limits.displacement_rate
    return max(_SURE * Priors().offset_share * robot.length, min(options.slack * robot.length, wound))


def _largest_tension(robot: Robot, free: Shape, options: PlanOptions) -> np.ndarray:
    """Return the tension (m,) in N up to which each cable is pulled: within its limits, and as far as the tip may turn.

    Turn and stroke are those of the linear response of the released robot.
    """
    limits, response = robot.limits, free.response
    turns = np.linalg.norm(response.compliance_ea[3:6], axis=0)
    stroke = limits.displacement_max - np.maximum(free.cable_displacement, limits.displacement_min)
    by_stroke = np.maximum(stroke, 0.0) / np.maximum(np.diag(response.compliance_aa), 1e-12)
    return np.minimum(np.minimum(options.tension * limits.tension_max, options.bend / np.maximum(turns, 1e-12)), by_stroke)


def _refuse_unseen(moves: np.ndarray, robot: Robot, options: PlanOptions, noise: TipNoise) -> None:
    """Raise ConfigError where no pull moves the tip by the deviation of a measured one.

    moves (k, 2): for each pull the tip's way in m and its turn in rad.
    """
    farthest, turn = moves.max(axis=0)
    deviation = noise.position_share * robot.length
    if farthest < deviation and turn < noise.direction:
        limits = robot.limits
        raise ConfigError(
            f"robot '{robot.name}': within robot.limits (displacement_min_mm: {1e3 * limits.displacement_min:.3g},"
            f" displacement_max_mm: {1e3 * limits.displacement_max:.3g}, and"
            f" {options.tension:.0%} of tension_max: {limits.tension_max:.3g}) no cable moves the tip by more than"
            f" {1e3 * farthest:.2g} mm and turns it by more than {math.degrees(turn):.2g} deg. A measured tip is uncertain by"
            f" {1e3 * deviation:.2g} mm and {math.degrees(noise.direction):.2g} deg; at least one of them is needed to plan a"
            " calibration"
        )


def _turned(shape: Shape, free: Shape) -> float:
    """Return the angle in rad between the tips of two shapes."""
    return float(np.arccos(np.clip(shape.tip_direction @ free.tip_direction, -1.0, 1.0)))


def _pose(
    robot: Robot,
    inclination: float,
    roll: float,
    shape: Shape,
    tension: np.ndarray,
    slack: float,
    transmission: Transmission | None,
) -> PlannedPose:
    released = np.maximum(shape.cable_displacement - slack, robot.limits.displacement_min)
    displacement = np.where(tension > 0.0, shape.cable_displacement, released)
    if transmission is not None:
        displacement = transmission.possible(displacement, tension)
    pulled = tuple(cable.name for cable, force in zip(robot.cables, tension) if force > 0.0)
    return PlannedPose(inclination, roll, displacement, pulled, tension, shape.tip_position)
