"""How far the robot is from what it should be, over whole runs.

Recovery rate, as the article uses it: Pearson's correlation between two courses of the tip over time. Here the three coordinates
are centred each on its own mean and pooled, so that a coordinate that hardly moves cannot dominate:

    r = sum_tk (a_tk - a_k)(b_tk - b_k) / sqrt(sum_tk (a_tk - a_k)^2 sum_tk (b_tk - b_k)^2)
"""

from dataclasses import dataclass

import numpy as np


def recovery_rate(a: np.ndarray, b: np.ndarray) -> float:
    """Pooled Pearson's r of two courses a, b (t, 3); NaN where one of them stands still."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    norm = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / norm) if norm > 0.0 else float("nan")


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...,) rad between vectors (..., 3); exact for small angles, where arccos is not."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))


@dataclass(frozen=True)
class TipErrors:
    """Of a course of t samples: distance, lateral (across the target's direction), axial (along it, signed) in m, tilt in rad; (t,) each."""

    distance: np.ndarray
    lateral: np.ndarray
    axial: np.ndarray
    tilt: np.ndarray


def tip_errors(
    position: np.ndarray, direction: np.ndarray, target_position: np.ndarray, target_direction: np.ndarray
) -> TipErrors:
    """Errors of tips at position (t, 3), pointing along direction (t, 3)."""
    error = position - target_position
    axial = (error * target_direction).sum(axis=-1)
    across = error - axial[..., None] * target_direction
    return TipErrors(
        np.linalg.norm(error, axis=-1), np.linalg.norm(across, axis=-1), axial, angle_between(direction, target_direction)
    )


def means(errors: TipErrors) -> TipErrors:
    """Each error's mean over the course, as floats."""
    return TipErrors(*(float(getattr(errors, name).mean()) for name in TipErrors.__dataclass_fields__))


def inclination_deg(gravity: np.ndarray) -> float:
    """Of the base, from gravity (3,) in soft_base: 0 where the robot's axis is horizontal, 90 where it points up."""
    return float(np.degrees(np.arctan2(-gravity[2], np.hypot(gravity[0], gravity[1]))))


def sag(backbone: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(t, n) m: distance of the backbone points (t, n, 3) from those of the target (n, 3), across the target's curve: the length that
    pulling cables take from the robot is no sag.
    """
    along = np.gradient(target, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    error = backbone - target
    return np.linalg.norm(error - (error * along).sum(axis=-1, keepdims=True) * along, axis=-1)


def mid_body_sag(backbone: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(t,) m: the largest `sag` but for base and tip."""
    return sag(backbone, target)[..., 1:-1].max(axis=-1)


def settling_time(time: np.ndarray, error: np.ndarray, *, start: float, band: float) -> float:
    """s from `start` until the error (t,) stays within `band` of its final value (mean of the last tenth); NaN: not within the run."""
    after = time >= start
    time, error = time[after], error[after]
    final = error[-max(1, len(error) // 10) :].mean()
    outside = np.flatnonzero(np.abs(error - final) > band)
    if len(outside) == 0:
        return 0.0
    return float(time[outside[-1] + 1] - start) if outside[-1] + 1 < len(time) else float("nan")
