"""Measures of whole runs: recovery rate, tip errors, sag, settling time.

Recovery rate, as the article uses it: Pearson's correlation between two courses of the tip over time. Here each coordinate is
centred on its own mean and all three are pooled, so that a coordinate that hardly moves cannot dominate:

    r = sum_tk (a_tk - a_k)(b_tk - b_k) / sqrt(sum_tk (a_tk - a_k)^2 sum_tk (b_tk - b_k)^2)
"""

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

Value = TypeVar("Value", np.ndarray, float)

CONVERGED = 5e-3
"""Of the robot's length: a tip has converged when it stays within it."""

SETTLED = 0.05
"""Of the sag: within it of its final place, a tip that is compensated has settled."""

_NO_MOTION = 1e-12  # m^2; rounding errors of a course at rest are below it


def recovery_rate(a: np.ndarray, b: np.ndarray) -> float:
    """Return the pooled Pearson's r of two courses a, b (t, 3) in m; NaN where one of them does not move."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    norm = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / norm) if norm > _NO_MOTION else float("nan")


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angles (...,) in rad between vectors (..., 3); exact for small angles, unlike arccos."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))


@dataclass(frozen=True)
class TipErrors(Generic[Value]):
    """Errors of the tip to its target: arrays (t,) over t samples, or floats as their means."""

    distance: Value  # m
    lateral: Value  # m, across the direction of the target
    axial: Value  # m, along it, signed
    tilt: Value  # rad, between the directions of tip and target


def tip_errors(
    position: np.ndarray, direction: np.ndarray, target_position: np.ndarray, target_direction: np.ndarray
) -> TipErrors[np.ndarray]:
    """Return the errors of tips at position (t, 3) m and direction (t, 3); targets (3,) or (t, 3)."""
    error = position - target_position
    axial = (error * target_direction).sum(axis=-1)
    across = error - axial[..., None] * target_direction
    return TipErrors(
        np.linalg.norm(error, axis=-1), np.linalg.norm(across, axis=-1), axial, angle_between(direction, target_direction)
    )


def means(errors: TipErrors[np.ndarray]) -> TipErrors[float]:
    """Return the mean of each error."""
    return TipErrors(*(float(getattr(errors, name).mean()) for name in TipErrors.__dataclass_fields__))


def inclination_deg(gravity: np.ndarray) -> float:
    """Return the inclination of the base from gravity (3,) in soft_base: 0 for a horizontal robot, 90 if it points up."""
    return float(np.degrees(np.arctan2(-gravity[2], np.hypot(gravity[0], gravity[1]))))


def sag(backbone: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the distances (t, n) in m of the backbone points (t, n, 3) from the target's (n, 3), across the target's curve.

    The shortening of the robot by its cables, along the curve, does not count.
    """
    along = np.gradient(target, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    error = backbone - target
    return np.linalg.norm(error - (error * along).sum(axis=-1, keepdims=True) * along, axis=-1)


def mid_body_sag(backbone: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the largest `sag` (t,) in m without base and tip."""
    return sag(backbone, target)[..., 1:-1].max(axis=-1)


def settling_time(time: np.ndarray, error: np.ndarray, *, start: float, band: float) -> float:
    """Return the time (s) from `start` until the error (t,) stays within `band` of its final value, the mean of the last tenth.

    NaN where it does not settle within the run.
    """
    after = time >= start
    time, error = time[after], error[after]
    final = error[-max(1, len(error) // 10) :].mean()
    outside = np.flatnonzero(np.abs(error - final) > band)
    if len(outside) == 0:
        return 0.0
    return float(time[outside[-1] + 1] - start) if outside[-1] + 1 < len(time) else float("nan")
