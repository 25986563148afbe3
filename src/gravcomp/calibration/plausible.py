"""Measurements that cannot be of the described robot: other units, another frame, a mirrored one, swapped cables, another robot.

Units show in the lengths of vectors: gravity, the tip's distance from the base; those of time in the robot's first period. A
wrong frame, swapped cables and displacements in other units show where the described robot explains the data much better once
they are exchanged; a frame that is turned by any angle or moved where the fitted robot does.
"""

import dataclasses
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gravcomp.calibration.measured import Measured, MeasurementError, StillWindows
from gravcomp.calibration.standstill import Standstill
from gravcomp.config import parameter
from gravcomp.description import Robot
from gravcomp.standard_gravity import STANDARD_GRAVITY

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_UNITS = {
    1e3: "a thousand times too large", 1e-3: "a thousand times too small", 25.4: "25.4 times too large",
    1 / 25.4: "25.4 times too small (inches?)", 10.0: "ten times too large", 0.1: "ten times too small (cm?)",
}  # fmt: skip
"""Factors by which units are confused, in words."""

_NEAR = 0.25  # relative distance from one of these factors
_GRAVITY = 0.1  # relative error of the length of gravity
_FEWEST_OF_FRAME = 6  # rests: fewer tips fit any robot after a turn and a motion


@dataclass(frozen=True)
class PlausibilityOptions:
    """When data count as those of another robot or frame; in shares of the robot's length."""

    reach: float = parameter(1.15, minimum=1.0, maximum=10.0, description="farthest a tip can be from the base, over the length")
    suspicious: float = parameter(
        0.02,
        minimum=1e-4,
        maximum=1.0,
        description="tip error from which on exchanged axes and cables are tried, over the length",
    )
    better: float = parameter(
        0.5, minimum=0.01, maximum=0.99, description="tip error of an exchange that convinces, over the own"
    )
    unexplained: float = parameter(
        0.03, minimum=1e-4, maximum=1.0, description="tip error after the fit that no robot like the described one has"
    )
    displaced: float = parameter(
        0.01, minimum=1e-4, maximum=1.0, description="tip error after the fit from which on another frame is tried"
    )
    sparse: float = parameter(
        10.0, minimum=1.0, maximum=1e3, description="longest time between samples, over that of a window at rest"
    )
    duration: float = parameter(36e3, unit="s", minimum=600.0, maximum=1e7, description="longest time of a trial")


def check_gravity(length: float, source: str, or_none: bool = False) -> None:
    """Raise MeasurementError where gravity, `length` in m/s^2, is not that of the earth; or_none: nor zero."""
    if abs(length / STANDARD_GRAVITY - 1.0) <= _GRAVITY or (or_none and length == 0.0):
        return
    guess = " (in g, not in m/s^2?)" if abs(length - 1.0) < _GRAVITY else ""
    allowed = f"{STANDARD_GRAVITY:.2f} +- {_GRAVITY:.0%}{', or 0,' if or_none else ''}"
    raise MeasurementError(f"{source}: gravity is {length:.3g} m/s^2 long{guess}; {allowed} is needed")


def check_units(robot: Robot, measured: Measured | StillWindows, source: str) -> None:
    """Raise MeasurementError where gravity, tips or displacements are in other units, or beyond what the robot can reach."""
    check_gravity(float(np.median(np.linalg.norm(measured.gravity, axis=1))), source)
    away = float(np.median(np.linalg.norm(measured.tip_position, axis=1))) / robot.length
    for factor, words in _UNITS.items():
        if abs(away / factor - 1.0) < _NEAR:
            raise MeasurementError(
                f"{source}: the tip is {1e3 * away * robot.length:.3g} mm from the base, and the robot is"
                f" {1e3 * robot.length:.3g} mm long: the positions are {words}; mm are needed in a table, m in a bag"
            )
    if away > PlausibilityOptions().reach:
        raise MeasurementError(
            f"{source}: the tip is {1e3 * away * robot.length:.3g} mm from the base, and the robot is"
            f" {1e3 * robot.length:.3g} mm long: the data are of another robot, or not in soft_base"
        )
    limits = robot.limits
    wound = measured.displacement[np.isfinite(measured.displacement)]
    span = limits.displacement_max - limits.displacement_min
    if len(wound) and np.abs(wound).max() > 20.0 * span:
        raise MeasurementError(
            f"{source}: a cable is displaced by {1e3 * np.abs(wound).max():.4g} mm, and the limits allow"
            f" {1e3 * limits.displacement_min:.3g} to {1e3 * limits.displacement_max:.3g} mm: they are in other units"
        )


def check_time(measured: Measured, still: Standstill) -> None:
    """Raise MeasurementError where the times of a course are in other units than s."""
    options = PlausibilityOptions()
    for trial in measured.trials():
        if len(trial.time) < 2:
            continue
        apart, whole = float(np.median(np.diff(trial.time))), float(np.ptp(trial.time))
        if apart > options.sparse * still.time or whole > options.duration:
            raise MeasurementError(
                f"{measured.source}: the samples of trial {trial.trial[0]} are {apart:.3g} s apart and last {whole:.3g} s;"
                f" allowed: {options.sparse * still.time:.2g} s (from the robot's first period) and {options.duration:.3g} s."
                " Are the times in ms? s are needed"
            )


def check_frame(
    robot: Robot,
    windows: StillWindows,
    tip: np.ndarray,
    swapped: Callable[[np.ndarray], np.ndarray],
) -> None:
    """Raise MeasurementError where exchanged axes or cables explain the data much better than the data as they are.

    tip (k, 6): as the described robot has it; swapped(displacement): the same for other displacements (k, m).
    """
    options = PlausibilityOptions()
    own = _distance(robot, windows, tip)
    if own < options.suspicious:
        return
    best, axes = min(((_distance(robot, windows, tip, a), a) for a in _axes()), key=lambda found: found[0])
    if best < options.better * own:
        kind = "mirrored (a left-handed tracker?)" if np.linalg.det(axes) < 0.0 else "in another frame than soft_base"
        raise MeasurementError(
            f"the measured tips are {kind}: with x, y, z of soft_base = {_words(axes)} of the measurement, the described robot's"
            f" tip error falls from {_mm(robot, own)} to {_mm(robot, best)}. If only the signs of x and y are wrong, gravity may"
            " have the sign of the specific force"
        )
    _check_displacements(robot, windows, own, swapped)


def _check_displacements(robot: Robot, windows: StillWindows, own: float, swapped: Callable[[np.ndarray], np.ndarray]) -> None:
    """Raise MeasurementError where exchanged cables or other units of the displacements explain the data much better.

    own: distance of the tips as the data are, over the length.
    """
    options = PlausibilityOptions()

    def distance(displacement: np.ndarray) -> float:
        try:
            return _distance(robot, windows, swapped(displacement))
        except RuntimeError:  # no equilibrium
            return np.inf

    wound = windows.displacement
    limits = robot.limits
    for factor, words in _UNITS.items():
        scaled = wound / factor
        inside = scaled[np.isfinite(scaled)]
        if not inside.any() or inside.max() > limits.displacement_max or inside.min() < limits.displacement_min:
            continue
        found = distance(scaled)
        if found < options.better * own:
            raise MeasurementError(
                f"the displacements of the cables are {words}: in the right unit, the described robot's tip error falls from"
                f" {_mm(robot, own)} to {_mm(robot, found)}; mm are needed in a table, m in a bag"
            )
    names = np.array(robot.cable_names)
    order, best = np.arange(len(names)), own
    while True:  # exchange by exchange: three cables in turn need two
        tried = []
        for a, b in itertools.combinations(range(len(names)), 2):
            other = order.copy()
            other[[a, b]] = order[[b, a]]
            if not np.allclose(wound[:, other], wound[:, order], equal_nan=True):
                tried.append((distance(wound[:, other]), tuple(other.tolist())))
        if not tried or min(tried)[0] >= best:
            break
        best, order = min(tried)[0], np.array(min(tried)[1])
    if best < options.better * own:
        moved = np.flatnonzero(order != np.arange(len(names)))
        *others, last = names[moved]
        exchanged = ", ".join(f"{names[order[k]]} is {names[k]}" for k in moved)
        raise MeasurementError(
            f"the cables {', '.join(others)} and {last} are swapped in these data ({exchanged}): exchanged, the described robot's"
            f" tip error falls from {_mm(robot, own)} to {_mm(robot, best)}"
        )


def check_explained(robot: Robot, windows: StillWindows, tip: np.ndarray) -> None:
    """Raise MeasurementError where even the fitted robot, whose tips are `tip` (k, 6), misses those of the windows.

    Either a rigid motion of the measured tips explains them much better, or no robot like this one has such tips.
    """
    options = PlausibilityOptions()
    left = _distance(robot, windows, tip)
    if left > options.displaced and windows.shares.sum() >= _FEWEST_OF_FRAME:
        turn, moved = _rigid(windows, tip)
        found = _distance(robot, dataclasses.replace(windows, tip_position=turn.apply(windows.tip_position) + moved), tip)
        if found < options.better * left:
            place = ", ".join(f"{1e3 * value:.1f}" for value in moved)
            raise MeasurementError(
                f"the measured tips are in another frame than soft_base: turned by {np.degrees(turn.magnitude()):.1f} deg and"
                f" moved by ({place}) mm, the fitted robot's tip error falls from {_mm(robot, left)} to {_mm(robot, found)}"
            )
    if left > options.unexplained:
        raise MeasurementError(
            f"no values describe these data: a tip error of {_mm(robot, left)} remains ({left:.1%} of the length; allowed:"
            f" {options.unexplained:.0%}). Are they of another robot, or in another frame than soft_base?"
        )


def _rigid(windows: StillWindows, tip: np.ndarray) -> tuple["Rotation", np.ndarray]:
    """Return the turn and the motion (3,) in m that bring the measured tips nearest to `tip` (k, 6)."""
    from scipy.spatial.transform import Rotation

    share = windows.shares / windows.shares.sum()
    measured, modelled = (points - share @ points for points in (windows.tip_position, tip[:, :3]))
    turn, _ = Rotation.align_vectors(modelled, measured, weights=share)
    return turn, share @ tip[:, :3] - turn.apply(share @ windows.tip_position)


def _distance(robot: Robot, windows: StillWindows, tip: np.ndarray, axes: np.ndarray | None = None) -> float:
    """Return the root mean square distance of measured tips from `tip`, over the length; axes (3, 3): of soft_base there."""
    axes = np.eye(3) if axes is None else axes
    error = (windows.tip_position @ axes.T - tip[:, :3]) / robot.length
    return float(np.sqrt((windows.shares * (error**2).sum(axis=1)).sum() / windows.shares.sum()))


def _axes() -> list[np.ndarray]:
    """Return all exchanges of axes and signs, without the identity."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            axes = np.zeros((3, 3))
            axes[np.arange(3), list(order)] = signs
            if not np.array_equal(axes, np.eye(3)):
                found.append(axes)
    return found


def _words(axes: np.ndarray) -> str:
    return ", ".join("-"[: int(row.sum() < 0)] + "xyz"[int(np.argmax(np.abs(row)))] for row in axes)


def _mm(robot: Robot, share: float) -> str:
    return f"{1e3 * share * robot.length:.2f} mm"
