"""The plan of a calibration: the poses that tell most about the robot, in the time that it may take.

Candidates are orientations of the base with the cables released, with one cable under a tension that the limits allow, or with
the cables that hold the robot in its shape at rest (`held_pose`). The model gives the derivatives J_k of the tip by all unknowns
of the fit (`unknowns`). Poses are chosen one by one so that they add most to

    log det (P + sum_k J_k^T W J_k)

for the time that they take (a turn of the base takes longer than a pull), with the prior P and the noise W of `fit`. This greedy
choice is D-optimal up to a constant factor, because the determinant's logarithm is submodular (Nemhauser, Wolsey and Fisher,
Math. Programming 14, 1978; for designs: Pukelsheim, Optimal Design of Experiments, 1993).
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.approach import APPROACH
from gravcomp.calibration.fit import TipNoise
from gravcomp.calibration.held_pose import held_at_rest
from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.parameters import starting_parameters
from gravcomp.calibration.statics import StaticPredictor
from gravcomp.calibration.unknowns import Priors, prior_rows, unknowns_of
from gravcomp.config import ConfigError, parameter
from gravcomp.description import Robot
from gravcomp.description.transmission import Transmission
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.inverse import InverseOptions
from gravcomp.mesh.coarse import with_coarse_elements
from gravcomp.simulation import Shape, Simulator
from gravcomp.standard_gravity import STANDARD_GRAVITY

_LEVELS = (0.35, 1.0)  # of the largest tension that is used: two are needed to distinguish an offset from a stretch
_MEAN_TURN = math.radians(80.0)  # of the base from station to station
_FARTHER = 1.5  # than the linear model expects, a tip may turn
_LEAST_REST = 0.3  # of the longest time that a pose may take
_MOST_OF_REST = 0.5  # is left out where turns take longer than was expected
_WIDEST = 0.5  # deviation of the logarithm of all moduli together before the measurement


@dataclass(frozen=True)
class PlanOptions:
    """How long a calibration takes, and how far it bends the robot."""

    budget: float = parameter(180.0, unit="s", minimum=10.0, maximum=3600.0, description="robot time of all poses together")
    periods: float = parameter(14.0, minimum=2.0, maximum=200.0, description="first periods of the robot at rest in each pose")
    fewest: int = parameter(12, minimum=3, maximum=200, description="poses for whose sake the time at rest is shortened")
    most: int = parameter(26, minimum=3, maximum=500, description="poses beyond which the time at rest is lengthened instead")
    rate: float = parameter(40.0, edge="deg", minimum=1.0, maximum=360.0, description="speed of the base's turns, deg/s")
    bend: float = parameter(35.0, edge="deg", minimum=1.0, maximum=180.0, description="largest turn of the tip by a cable")
    slack: float = parameter(
        0.05, minimum=1e-3, maximum=1.0, description="of a released cable beyond its path, over the robot's length"
    )
    tension: float = parameter(0.7, minimum=0.01, maximum=1.0, description="largest tension, over the limit")


@dataclass(frozen=True)
class PlannedPose:
    """One pose: the base at inclination and roll in rad (`virtual.motion`), the cables at `displacement` (m,) in m.

    pulled: names of the cables that are to be taut; tension (m,) in N and tip (3,) in m: as the model expects them.
    """

    inclination: float
    roll: float
    displacement: np.ndarray
    pulled: tuple[str, ...]
    tension: np.ndarray
    tip: np.ndarray

    @property
    def station(self) -> tuple[float, float]:
        """Inclination and roll, by which poses with the same orientation of the base are known."""
        return self.inclination, self.roll

    @property
    def gravity(self) -> np.ndarray:
        """Gravity (3,) in m/s^2 in soft_base."""
        return gravity_of(self.inclination, self.roll)


@dataclass(frozen=True)
class Plan:
    """Poses in the order in which they are measured.

    times: for which each is held in s, with the move of the cables; rate: of the base's turns in rad/s; rest: time at rest in s.
    """

    poses: tuple[PlannedPose, ...]
    times: tuple[float, ...]
    rest: float
    rate: float

    @property
    def duration(self) -> float:
        """Robot time in s, with the turns of the base."""
        return sum(self.times) + sum(turn_time(a, b, self.rate) for a, b in zip(self.poses, self.poses[1:]))


def turn_time(one: PlannedPose, other: PlannedPose, rate: float) -> float:
    """Return the time in s of the turn of the base between two poses at `rate` rad/s."""
    from scipy.spatial.transform import Rotation

    a, b = (Rotation.from_euler("yz", [-pose.inclination, pose.roll]) for pose in (one, other))
    return float((a.inv() * b).magnitude()) / rate


def creep_times(rest: float) -> tuple[float, ...]:
    """Return the times in s of the branches of creep that rests of `rest` s show: below them, and beyond."""
    return 0.3 * rest, 3.0 * rest


def gravity_of(inclination: float, roll: float) -> np.ndarray:
    """Return gravity (3,) in m/s^2 in soft_base for an inclination of the robot's axis and a roll about it, in rad."""
    c, s = math.cos(inclination), math.sin(inclination)
    return -STANDARD_GRAVITY * np.array([c * math.cos(roll), -c * math.sin(roll), s])


ORIENTATIONS = tuple(
    (math.radians(inclination), math.radians(roll))
    for inclination, rolls in ((0.0, range(0, 360, 60)), (45.0, range(30, 360, 120)), (-45.0, range(90, 450, 120)))
    for roll in rolls
)
"""Inclination and roll of the candidates in rad."""


def make_plan(
    robot: Robot,
    period: float,
    transmission: Transmission | None = None,
    options: PlanOptions | None = None,
    progress: Callable[[str], None] = lambda sentence: None,
    orientations: tuple[tuple[float, float], ...] = ORIENTATIONS,
    inverse: InverseOptions | None = None,
) -> Plan:
    """Return the plan for a robot with the first period `period` in s.

    Raises ConfigError where the limits allow no pose, and where no pull that they allow shows in a measured tip.

    orientations: candidates, inclination and roll of the base in rad; inverse: of the controller, to hold the robot in its shape
    at rest in some of the poses; None: only one cable at a time is pulled, as by hand.
    """
    options, priors, noise = options or PlanOptions(), Priors(), TipNoise()
    robot = with_coarse_elements(robot)
    candidates, usual, shapes = _candidates(robot, transmission, options, noise, progress, orientations, inverse)
    if not candidates:
        raise ConfigError(
            f"robot '{robot.name}': in none of {len(orientations)} orientations has the released robot an equilibrium within"
            " the limits of its cables; no calibration can be planned"
        )
    windows = StillWindows(
        np.array([pose.gravity for pose in candidates]),
        np.array([pose.displacement for pose in candidates]),
        np.zeros((len(candidates), 3)),
        np.tile([0.0, 0.0, 1.0], (len(candidates), 1)),
    )
    predictor = StaticPredictor(robot, windows, near=shapes)
    initial = starting_parameters(robot, ())
    try:
        predicted = predictor.predict(initial)
    except RuntimeError as error:  # an equilibrium that a search finds may not be reached from the other poses
        raise ConfigError(f"robot '{robot.name}': {error}; no calibration can be planned") from None
    unknowns = unknowns_of(robot, predicted, initial, None, priors)
    progress(f"planning: sensitivities of {len(candidates)} poses")
    derivatives = predictor.differentiate(initial, {unknown.kind for unknown in unknowns})
    scale = 1.0 / np.repeat([noise.position_share * robot.length, noise.direction], 3)
    rows = np.stack([unknown.derivative(derivatives) for unknown in unknowns], axis=2) * scale[:, None]
    prior = np.vstack([prior_rows(unknowns, priors), [(u.kind == "modulus") / _WIDEST for u in unknowns]])
    longest = options.budget / options.fewest
    wanted = float(np.clip(options.periods * period, options.budget / options.most, longest))
    pull = _pull_time(candidates, robot)
    rest = max(wanted - pull, _LEAST_REST * longest)
    held = rest + pull
    chosen = _chosen(candidates, usual, rows, prior, held, options)
    if not chosen:
        raise ConfigError(
            f"robot '{robot.name}': no pose of {held:.0f} s fits into {options.budget:.0f} s; allow more time (--time)"
        )
    poses = _ordered([candidates[k] for k in chosen])
    free = next(pose for pose in candidates if pose.station == poses[-1].station and not pose.pulled)
    poses.append(free)  # let go at the end, it swings: the damping
    plan = Plan(tuple(poses), (held,) * len(poses), rest, options.rate)
    # Turns were estimated while poses were chosen.
    less = min(max(plan.duration - options.budget, 0.0) / len(poses), _MOST_OF_REST * rest)
    return dataclasses.replace(plan, times=(held - less,) * len(poses), rest=rest - less)


def _candidates(
    robot: Robot,
    transmission: Transmission | None,
    options: PlanOptions,
    noise: TipNoise,
    progress: Callable[[str], None],
    orientations: tuple[tuple[float, float], ...],
    inverse: InverseOptions | None,
) -> tuple[list[PlannedPose], list[bool], list[Equilibrium]]:
    """Return the poses that the limits allow, whether each is measured at every station, and their shapes."""
    simulator = Simulator(robot, reduced=False)
    found: list[tuple[PlannedPose, bool, Equilibrium]] = []
    moves: list[tuple[float, float]] = []
    count = len(robot.cables)
    slack = options.slack * robot.length
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


def _chosen(
    candidates: list[PlannedPose],
    usual: list[bool],
    rows: np.ndarray,
    prior: np.ndarray,
    held: float,
    options: PlanOptions,
) -> list[int]:
    """Return the chosen candidates.

    usual: which are measured at every station that is visited: the released robot, which no error of a cable disturbs, and the
    one that is held at rest; rows (k, 6, u): derivatives over the noise; held: time in s of each pose.
    """
    information = prior.T @ prior
    always: dict[tuple[float, float], list[int]] = {}
    for k, pose in enumerate(candidates):
        always.setdefault(pose.station, []).extend([k] * usual[k])
    chosen: list[int] = []
    turn = _MEAN_TURN / options.rate
    spent, stations = held, set()  # the last pose, released
    while True:
        factor = np.linalg.inv(information)
        gain = np.linalg.slogdet(np.eye(6) + np.einsum("kiu,uv,kjv->kij", rows, factor, rows))[1]
        new = [[k] if pose.station in stations else sorted({k, *always[pose.station]}) for k, pose in enumerate(candidates)]
        cost = held * np.array([len(poses) for poses in new])
        cost = cost + np.array([0.0 if pose.station in stations else turn for pose in candidates])
        gain = gain / cost
        gain[chosen] = -np.inf
        gain[spent + cost > options.budget] = -np.inf
        best = int(np.argmax(gain))
        if not gain[best] > 0.0:
            return chosen
        spent += float(cost[best])
        for k in new[best]:
            information = information + rows[k].T @ rows[k]
        chosen += new[best]
        stations.add(candidates[best].station)


def _pull_time(candidates: list[PlannedPose], robot: Robot) -> float:
    """Return the time in s of the largest move of the cables."""
    moves = np.ptp(np.array([pose.displacement for pose in candidates]), axis=0).max(initial=0.0)
    return float(moves / robot.limits.displacement_rate) + APPROACH


def _ordered(poses: list[PlannedPose]) -> list[PlannedPose]:
    """Return the poses station by station, each next to the one before.

    Released first, then held at rest, then cable by cable: so the cables are wound in to where they pull. After the held robot
    comes a cable that has to be pulled further than it is there, where there is one.
    """
    left, ordered = list(poses), []
    here = min(left, key=lambda pose: (bool(pose.pulled), abs(pose.inclination), pose.roll))
    while left:
        station = [pose for pose in left if pose.station == here.station]
        back = _paid_out_from_held(station)
        ordered += sorted(
            station,
            key=lambda pose: (
                bool(pose.pulled), -len(pose.pulled), pose.pulled in back, pose.pulled, float(pose.tension.sum())
            ),
        )  # fmt: skip
        left = [pose for pose in left if not any(pose is one for one in station)]
        if left:
            here = max(left, key=lambda pose: float(pose.gravity @ ordered[-1].gravity))
    return ordered


def _paid_out_from_held(station: list[PlannedPose]) -> set[tuple[str, ...]]:
    """Return the cables, as they are pulled alone, that are farther out in some such pose than in that of the held robot."""
    held = max(station, key=lambda pose: len(pose.pulled))
    if len(held.pulled) < 2:
        return set()
    single = [pose for pose in station if len(pose.pulled) == 1]
    return {pose.pulled for pose in single if (pose.displacement < held.displacement)[pose.tension > 0.0].any()}
