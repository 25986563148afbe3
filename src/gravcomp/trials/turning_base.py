"""The loop held straight while its base turns from orientation to orientation and rests at each: errors at rest and in motion.

The share of a residual is of what the robot sags without compensation: the lateral distance of the released virtual robot's tip
from the target, from its statics, as the root of the mean square over all orientations of the run. One orientation would not do:
a hanging robot does not sag at all.
"""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.trials.holding import Case, target_of
from gravcomp.virtual.body import build_rod, first_frequency
from gravcomp.virtual.equilibrium import NoEquilibrium, equilibrium
from gravcomp.virtual.motion import WaypointMotion, base_orientation

INCLINATIONS = (135.0, 90.0, 45.0, 0.0, -45.0)
"""Degrees: the article's five poses."""

RATE = math.radians(30.0)  # rad/s, mean of each turn
_PERIODS = 10  # of the first bending motion, after which it has died away
_REACTION = 1.0  # s for filter and controller to settle
_COUNTED = 0.5  # s at the end of each rest


@dataclass(frozen=True)
class Residuals:
    """Root mean squares of lateral distances of the true tip from the straight robot's, in m; NaN where nothing is counted.

    held: at the end of each rest; moving: during the turns; sag: released, at the same orientations; orientations: their number,
    without those at which the released robot has no equilibrium; settled: s from the start of compensation until the tip stays
    within a twentieth of the sag there, NaN: never.
    """

    held: float
    moving: float
    sag: float
    orientations: int
    settled: float


def orientations(count: int, seed: int) -> list[np.ndarray]:
    """Return the rotations (3, 3), world from soft_base, of the five poses and of `count` random ones, uniform on the sphere."""
    random = np.random.default_rng(seed)
    inclination, roll = np.arcsin(random.uniform(-1.0, 1.0, count)), random.uniform(-np.pi, np.pi, count)
    five = [base_orientation(math.radians(angle)) for angle in INCLINATIONS]
    return five + [base_orientation(*angles) for angles in zip(inclination, roll)]


def residuals(setup: Setup, count: int = 20, orientation_seed: int = 1, board: str = "virtual") -> Residuals:
    """Run the loop through the five poses and `count` random ones, with this board of the virtual robot. Raises ConfigError, NoEquilibrium, RuntimeError."""
    wanted = orientations(count, orientation_seed)
    rest = _REACTION + _PERIODS * 2.0 * math.pi / first_frequency(build_rod(setup.true_robot)) + _COUNTED
    motion = WaypointMotion([(one, rest if k else 2.0 * rest) for k, one in enumerate(wanted)], RATE)
    loop = ClosedLoop(setup, motion, board=board)
    loop.hold(target_of(setup, Case(0.0)))
    start = loop.time
    legs = motion.rests
    loop.run(legs[-1][1] - start)
    trace = loop.trace
    held = [_lateral(trace.between(end - _COUNTED, end)) for _, end in legs]
    turns = [_lateral(trace.between(end, begin)) for (_, end), (begin, _) in zip(legs, legs[1:])]
    sags = _released(setup, wanted)
    sag = _rms(sags)
    first = trace.between(start, legs[0][1])
    outside = np.flatnonzero(_lateral(first) > 0.05 * sag)
    settled = 0.0 if not len(outside) else first.time[min(outside[-1] + 1, len(first.time) - 1)] - start
    never = len(outside) > 0 and outside[-1] + 1 >= len(first.time)
    return Residuals(
        held=_rms(held), moving=_rms(turns), sag=sag, orientations=len(sags), settled=math.nan if never else float(settled)
    )


def _released(setup: Setup, wanted: list[np.ndarray]) -> list[np.ndarray]:
    """Lateral distances (1,) in m of the released virtual robot's tip, where it has an equilibrium."""
    rod, found = build_rod(setup.true_robot), []
    for orientation in wanted:
        try:
            shape = equilibrium(rod, orientation.T @ np.array([0.0, 0.0, -STANDARD_GRAVITY]))
        except NoEquilibrium:
            continue
        found.append(np.linalg.norm(shape.tip[None, :2], axis=1))
    return found


def _lateral(trace: Trace) -> np.ndarray:
    return np.linalg.norm(trace.tip_position[:, :2], axis=1)


def _rms(parts: list[np.ndarray]) -> float:
    """Root mean square over all parts, each of which counts the same; NaN without parts."""
    means = [float((part**2).mean()) for part in parts if len(part)]
    return math.sqrt(sum(means) / len(means)) if means else math.nan
