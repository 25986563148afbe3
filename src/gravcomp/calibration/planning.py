"""Planning a calibration: the poses that tell most about the robot, in the time that it may take.

The model gives the derivatives J_k of the tip by all unknowns of the fit (`unknowns`) in each candidate (`pose_candidates`).
Poses are chosen one by one so that they lower most, for the time that they take (a turn of the base takes longer than a pull),

    tr (C A),    C = (P + sum_k J_k^T W J_k)^-1,    A = mean over the poses of use of J^T W J + ...

with the prior P and the noise W of `fit`: Bayesian A-optimality (Chaloner and Verdinelli, Statistical Science 10, 1995). It is
the squared error of the tip that is left in the poses in which the robot is used, released and held at rest in all orientations;
pulls of single cables count less, and the moduli by themselves, because errors of two segments can cancel at the tip. The
determinant of C counts each unknown alike instead: it spends the time on places and zeros of single cables, in the fewest
orientations, which hardly tell mount and bias of the IMU.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from gravcomp.calibration.approach import APPROACH
from gravcomp.calibration.fit import TipNoise
from gravcomp.calibration.force_length import bias_rows, scale_rows
from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.parameters import starting_parameters
from gravcomp.calibration.plan import Plan, PlannedPose, PlanOptions
from gravcomp.calibration.pose_candidates import ORIENTATIONS, pose_candidates
from gravcomp.calibration.statics import StaticPredictor
from gravcomp.calibration.unknowns import Priors, Unknown, prior_rows, unknowns_of
from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.description.transmission import Transmission
from gravcomp.inverse import InverseOptions
from gravcomp.mesh.coarse import with_coarse_elements
from gravcomp.orientation.calibration import POSE_NOISE

_MEAN_TURN = math.radians(80.0)  # of the base from station to station
_LEAST_REST = 0.3  # of the longest time that a pose may take
_MOST_OF_REST = 0.5  # is left out where turns take longer than was expected
_WIDEST = 0.5  # deviation of the logarithm of all moduli together before the measurement
_PULL = 0.25  # what the tips under pulls of single cables count, of those in use
_MODULUS = 0.04  # relative error of a modulus that counts as much as a tip that is wrong by one deviation


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
    candidates, usual, shapes = pose_candidates(robot, transmission, options, noise, progress, orientations, inverse)
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
    assured = options.assured * held + _MEAN_TURN / options.rate if options.assured else 0.0
    options = dataclasses.replace(options, budget=max(options.budget, assured))
    sought = _sought(rows, usual, unknowns)
    if inverse is not None:  # with motors there is an IMU
        rows, prior, sought = _with_force_lengths(rows, prior, sought, windows.gravity, unknowns, robot, priors)
    chosen = _chosen(candidates, usual, rows, prior, sought, held, options)
    if not chosen:  # there is no time for what is usual at every station
        chosen = _chosen(candidates, [False] * len(usual), rows, prior, sought, held, options)
    if not chosen:
        raise ConfigError(
            f"robot '{robot.name}': no pose of {held:.0f} s fits into {options.budget:.0f} s; allow more time (--time)"
        )
    poses = _ordered([candidates[k] for k in chosen])
    free = next(pose for pose in candidates if pose.station == poses[-1].station and not pose.pulled)
    poses.append(free)  # let go at the end, it swings: the damping
    slow = wanted - pull < _LEAST_REST * longest and len(poses) < options.fewest
    note = _too_few(len(poses), pull, held, options) if slow else ""
    plan = Plan(tuple(poses), (held,) * len(poses), rest, options.rate, note)
    # Turns were estimated while poses were chosen.
    less = min(max(plan.duration - options.budget, 0.0) / len(poses), _MOST_OF_REST * rest)
    return dataclasses.replace(plan, times=(held - less,) * len(poses), rest=rest - less)


def _chosen(
    candidates: list[PlannedPose],
    usual: list[bool],
    rows: np.ndarray,
    prior: np.ndarray,
    sought: np.ndarray,
    held: float,
    options: PlanOptions,
) -> list[int]:
    """Return the chosen candidates.

    usual: which are measured at every station that is visited: the released robot, which no error of a cable disturbs, and the
    one that is held at rest; rows (k, 6, u): derivatives over the noise; sought (u, u): A; held: time in s of each pose.
    """
    information = prior.T @ prior
    always: dict[tuple[float, float], list[int]] = {}
    for k, pose in enumerate(candidates):
        always.setdefault(pose.station, []).extend([k] * usual[k])
    chosen: list[int] = []
    turn = _MEAN_TURN / options.rate
    spent, stations = held, set()  # the last pose, released
    while True:
        factor = np.linalg.inv(information)  # C
        new = [[k] if pose.station in stations else sorted({k, *always[pose.station]}) for k, pose in enumerate(candidates)]
        gain = np.array([_gain(factor, rows[poses].reshape(-1, rows.shape[2]), sought) for poses in new])
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


def _with_force_lengths(
    rows: np.ndarray,
    prior: np.ndarray,
    sought: np.ndarray,
    gravity: np.ndarray,
    unknowns: list[Unknown],
    robot: Robot,
    priors: Priors,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows (k, 7, u + 3), prior and A with the length of the specific force in each pose, and the scales behind it."""
    count, _, known = rows.shape
    found = np.zeros((count, 7, known + 3))
    found[:, :6, :known] = rows
    found[:, 6, :known] = bias_rows(gravity, unknowns) / POSE_NOISE
    found[:, 6, known:] = scale_rows(gravity, robot.imu_mount.rotation, priors) / POSE_NOISE
    wider = [np.pad(one, ((0, 3), (0, 3))) for one in (prior, sought)]
    wider[0][-3:, -3:] = np.eye(3)
    return found, wider[0], wider[1]


def _sought(rows: np.ndarray, usual: list[bool], unknowns: list[Unknown]) -> np.ndarray:
    """Return A (u, u) from rows (k, 6, u); usual: the poses of use."""
    squares, used = np.einsum("kiu,kiv->kuv", rows, rows), np.array(usual)
    found = squares[used].mean(axis=0)
    if not used.all():
        found = found + _PULL * squares[~used].mean(axis=0)
    return np.asarray(found + np.diag([(unknown.kind == "modulus") / _MODULUS**2 for unknown in unknowns]))


def _gain(covariance: np.ndarray, rows: np.ndarray, sought: np.ndarray) -> float:
    """Return by how much rows (r, u) over the noise lower the trace of covariance (u, u) times sought (u, u)."""
    known = rows @ covariance
    return float(np.sum(np.linalg.solve(np.eye(len(rows)) + known @ rows.T, known) * (known @ sought)))


def _too_few(count: int, pull: float, held: float, options: PlanOptions) -> str:
    """Return what limits a plan of `count` poses that are held for `held` s, of which the cables move for `pull` s."""
    return (
        f"there is time for {count} poses of {held:.1f} s only ({options.fewest} and more are wanted): moves of the cables take"
        f" up to {pull:.1f} s of each. More time (--time), or capstans that wind in faster, let the data tell more"
    )


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
