"""The loop holds the shape at rest while its base turns from orientation to orientation and rests at each: errors in both.

The base turns from one direction of gravity to the next by the smallest angle, about a horizontal axis, and takes the random ones
in the order of the nearest: a turn about the vertical changes nothing for the robot and would only take time.

The share of a residual is of what the robot sags without compensation: the lateral distance of the released virtual robot's tip
from the target, from its statics, as the root of the mean square over all orientations of the run. One orientation would not do:
a hanging robot does not sag at all.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.evaluation.metrics import SETTLED, settling_time, tip_errors
from gravcomp.inverse import Target
from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.trials.holding import Case, target_of
from gravcomp.virtual.body import build_rod
from gravcomp.virtual.equilibrium import NoEquilibrium, equilibrium
from gravcomp.virtual.motion import WaypointMotion, base_orientation, turned

INCLINATIONS = (135.0, 90.0, 45.0, 0.0, -45.0)
"""Degrees: the article's five poses."""

RATE = math.radians(30.0)  # rad/s, mean of each turn
_PERIODS = 4  # of the first bending motion, which the turns hardly excite
_REACTION = 0.6  # s for filter and controller to settle
_COUNTED = 0.3  # s at the end of each rest


@dataclass(frozen=True)
class Residuals:
    """Root mean squares of lateral distances of the true tip from that of the shape at rest, in m; NaN where nothing is counted.

    held: at the end of each rest; moving: during the turns; sag: released, at the same orientations; orientations: their number,
    without those at which the released robot has no equilibrium; settled: s from the start of compensation until the lateral
    distance stays within a twentieth of the sag of where it comes to rest, NaN: it does not.
    """

    held: float
    moving: float
    sag: float
    orientations: int
    settled: float


def orientations(count: int, seed: int, inclinations: tuple[float, ...] = INCLINATIONS) -> list[np.ndarray]:
    """Return the rotations (3, 3), world from soft_base, of the poses and of `count` random ones, in the order of the run.

    The directions of gravity of the random ones are uniform on the sphere.
    """
    poses = [base_orientation(math.radians(angle)) for angle in inclinations]
    found = [poses[0]]
    for pose in poses[1:]:
        found.append(_turned_upright(found[-1], pose[2]))
    left = np.random.default_rng(seed).standard_normal((count, 3))
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    while len(left):
        nearest = int(np.argmax(left @ found[-1][2]))
        found.append(_turned_upright(found[-1], left[nearest]))
        left = np.delete(left, nearest, axis=0)
    return found


def _turned_upright(orientation: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the orientation (3, 3), by the smallest turn from the given one, at which `up` (3,) in soft_base points upward."""
    axis = np.cross(up, orientation[2])
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, float(up @ orientation[2]))
    if sine < 1e-9:  # the same direction, or the opposite one by any axis across
        axis, sine = np.cross(orientation[2], orientation[0] + 2.0 * orientation[1]), 1.0
        axis /= np.linalg.norm(axis)
    return orientation @ turned(angle / sine * axis)


def residuals(
    setup: Setup,
    count: int = 20,
    orientation_seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
    board: str = "virtual",
    inclinations: tuple[float, ...] = INCLINATIONS,
) -> Residuals:
    """Run the loop through the poses at `inclinations` (deg) and `count` random ones.

    progress receives the number of orientations that are done, and that of all; board: of the virtual robot. Raises ConfigError,
    NoEquilibrium, RuntimeError.
    """
    wanted = orientations(count, orientation_seed, inclinations)
    rest = _REACTION + _PERIODS * setup.first_period + _COUNTED
    motion = WaypointMotion([(one, rest if k else 2.0 * rest) for k, one in enumerate(wanted)], RATE)
    loop = ClosedLoop(setup, motion, board=board)
    target = target_of(setup, Case(0.0))
    loop.hold(target)
    start = loop.time
    legs = motion.rests
    for done, (_, end) in enumerate(legs):
        loop.run(end - loop.time)
        if progress is not None:
            progress(done + 1, len(legs))
    trace = loop.trace
    held = [_lateral(trace.between(end - _COUNTED, end).tip_position, target) for _, end in legs]
    turns = [_lateral(trace.between(end, begin).tip_position, target) for (_, end), (begin, _) in zip(legs, legs[1:])]
    sags = _released(setup, wanted, target)
    sag = _rms(sags)
    first = trace.between(start, legs[0][1])
    settled = settling_time(first.time, _lateral(first.tip_position, target), start=start, band=SETTLED * sag)
    return Residuals(held=_rms(held), moving=_rms(turns), sag=sag, orientations=len(sags), settled=settled)


def _released(setup: Setup, wanted: list[np.ndarray], target: Target) -> list[np.ndarray]:
    """Lateral distances (1,) in m of the released virtual robot's tip from the target, where it has an equilibrium."""
    rod, found = build_rod(setup.true_robot), []
    for orientation in wanted:
        try:
            shape = equilibrium(rod, orientation.T @ np.array([0.0, 0.0, -STANDARD_GRAVITY]))
        except NoEquilibrium:
            continue
        found.append(_lateral(shape.tip[None], target))
    return found


def _lateral(tips: np.ndarray, target: Target) -> np.ndarray:
    """Lateral distances (t,) in m of tips (t, 3) from the target."""
    along = target.direction_or_zeros
    return tip_errors(tips, along, target.tip_position, along).lateral


def _rms(parts: list[np.ndarray]) -> float:
    """Root mean square over all parts, each of which counts the same; NaN without parts."""
    means = [float((part**2).mean()) for part in parts if len(part)]
    return math.sqrt(sum(means) / len(means)) if means else math.nan
