"""Measurements that cannot be of the described robot: other units, another frame, a mirrored one, swapped cables, another robot.

Units show in the lengths of vectors: gravity, the tip's distance from the base. A wrong frame and swapped cables show where the
described robot explains the data much better once axes or cables are exchanged.
"""

import dataclasses
import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import Measured, MeasurementError, StillWindows
from gravcomp.config import parameter
from gravcomp.description import Robot
from gravcomp.standard_gravity import STANDARD_GRAVITY

_UNITS = {
    1e3: "a thousand times too large", 1e-3: "a thousand times too small", 25.4: "25.4 times too large",
    1 / 25.4: "25.4 times too small (inches?)", 10.0: "ten times too large", 0.1: "ten times too small (cm?)",
}  # fmt: skip
"""Factors by which units are confused, in words."""

_NEAR = 0.25  # relative distance from one of these factors
_GRAVITY = 0.1  # relative error of the length of gravity


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


def check_units(robot: Robot, measured: Measured | StillWindows, source: str) -> None:
    """Raise MeasurementError where gravity, tips or displacements are in other units, or beyond what the robot can reach."""
    gravity = float(np.median(np.linalg.norm(measured.gravity, axis=1)))
    if abs(gravity / STANDARD_GRAVITY - 1.0) > _GRAVITY:
        guess = " (in g, not in m/s^2?)" if abs(gravity - 1.0) < _GRAVITY else ""
        raise MeasurementError(
            f"{source}: gravity is {gravity:.3g} m/s^2 long{guess}; {STANDARD_GRAVITY:.2f} +- {_GRAVITY:.0%} is needed"
        )
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


def check_frame(
    robot: Robot,
    windows: StillWindows,
    tip: np.ndarray,
    swapped: Callable[[StillWindows], np.ndarray],
) -> None:
    """Raise MeasurementError where exchanged axes or cables explain the data much better than the data as they are.

    tip (k, 6): as the described robot has it; swapped(windows): the same for windows with other displacements.
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
    names = robot.cable_names
    found = []
    for a, b in itertools.combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[a, b]] = b, a
        if np.allclose(windows.displacement, windows.displacement[:, order], equal_nan=True):
            continue
        try:
            exchanged = swapped(dataclasses.replace(windows, displacement=windows.displacement[:, order]))
        except RuntimeError:  # no equilibrium
            continue
        found.append((_distance(robot, windows, exchanged), names[a], names[b]))
    if found and min(found)[0] < options.better * own:
        best, one, other = min(found)
        raise MeasurementError(
            f"the cables {one} and {other} are swapped in these data: exchanged, the described robot's tip error falls from"
            f" {_mm(robot, own)} to {_mm(robot, best)}"
        )


def check_explained(robot: Robot, rms_after: float) -> None:
    """Raise MeasurementError where even the fitted robot misses the tips by rms_after (m), as no robot like this one does."""
    options = PlausibilityOptions()
    if rms_after > options.unexplained * robot.length:
        raise MeasurementError(
            f"no values describe these data: a tip error of {1e3 * rms_after:.2f} mm remains ({rms_after / robot.length:.1%} of"
            f" the length; allowed: {options.unexplained:.0%}). Are they of another robot, or in another frame than soft_base?"
        )


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
