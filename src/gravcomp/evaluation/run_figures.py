"""Figures of a run on the virtual robot: sag without compensation, error with it, and agreement of the model.

sag: mean distance of the true tip from that of the straight robot, with released cables, at rest.
held, moving: the lateral part of it while the base rests, and while it turns.
residual: root mean square of the true tip's distance from the target across (lateral) and along (axial) the target's direction.
correlation: Pearson's r between modelled and true tip over time (recovery rate).
"""

import math

import numpy as np

from gravcomp.evaluation import metrics
from gravcomp.evaluation.track import Track

_AT_REST, _JUST = 1.0, 0.1  # s
_TURN_RATE = math.radians(1.0)  # rad/s, slowest turn that counts as motion


def sag(truth_tip: Track, straight: np.ndarray, begin: float, end: float) -> float | None:
    """Return the sag in m from the time `begin` to `end` (s); straight (3,): tip of the straight robot. None without samples."""
    _, tip = truth_tip.between(begin, end)
    return float(np.linalg.norm(tip - straight, axis=1).mean()) if len(tip) else None


def residual(truth_tip: Track, target: np.ndarray, direction: np.ndarray, begin: float, end: float) -> tuple[float, float] | None:
    """Return the lateral and the axial RMS error in m to the target with position and direction (3,); None without samples."""
    _, tip = truth_tip.between(begin, end)
    if not len(tip):
        return None
    errors = metrics.tip_errors(tip, direction, target, direction)
    return float(np.sqrt((errors.lateral**2).mean())), float(np.sqrt((errors.axial**2).mean()))


def rest_and_motion(gravity: Track, stamps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return for the stamps (t,) in s whether the base has been at rest for `_AT_REST`, and whether it turns at present.

    gravity: the true one, m/s^2, of a base that turns about any but the vertical axis.
    """
    now, before, long_before = (gravity.at(stamps - ago) for ago in (0.0, _JUST, _AT_REST))
    turning = metrics.angle_between(now, before) > _TURN_RATE * _JUST
    resting = metrics.angle_between(now, long_before) <= _TURN_RATE * _JUST
    return resting & ~turning, turning


def correlation(truth_tip: Track, model_tip: Track, begin: float, end: float) -> float | None:
    """Return r; None with fewer than two common samples and where nothing moves."""
    stamps, truth = truth_tip.between(begin, end)
    model = model_tip.at(stamps)
    both = np.isfinite(model).all(axis=1)
    if both.sum() < 2:
        return None
    r = metrics.recovery_rate(truth[both], model[both])
    return r if math.isfinite(r) else None


def gravity_error(truth: Track, estimate: Track, begin: float, end: float) -> float | None:
    """Return the RMS angle in rad between true and estimated gravity; None without common samples."""
    stamps, true = truth.between(begin, end)
    own = estimate.at(stamps)
    both = np.isfinite(own).all(axis=1)
    if not both.any():
        return None
    return float(np.sqrt((metrics.angle_between(true[both], own[both]) ** 2).mean()))


def settled(
    truth_tip: Track, target: np.ndarray, direction: np.ndarray, begin: float, end: float, sag_size: float
) -> float | None:
    """Return the time (s) from `begin` until the lateral error stays within a twentieth of the sag of its final value.

    None without samples until `end`, and where it does not settle.
    """
    stamps, tip = truth_tip.between(begin, end)
    if not len(tip):
        return None
    lateral = metrics.tip_errors(tip, direction, target, direction).lateral
    time = metrics.settling_time(stamps, lateral, start=begin, band=metrics.SETTLED * sag_size)
    return time if math.isfinite(time) else None


def held_and_moving(
    truth_tip: Track, gravity: Track, target: np.ndarray, direction: np.ndarray, begin: float, end: float
) -> tuple[float | None, float | None]:
    """Return the lateral RMS errors in m while the base rests and while it turns; None where it does not.

    Arguments as those of `residual`; gravity: see `rest_and_motion`.
    """
    stamps, tip = truth_tip.between(begin, end)
    if not len(tip):
        return None, None
    lateral = metrics.tip_errors(tip, direction, target, direction).lateral
    held, moving = (
        float(np.sqrt((lateral[part] ** 2).mean())) if part.any() else None for part in rest_and_motion(gravity, stamps)
    )
    return held, moving


def rate(stamps: np.ndarray) -> float | None:
    """Return the samples per second between the first and the last stamp (s); None where there is no interval."""
    if len(stamps) < 2 or stamps[-1] <= stamps[0]:
        return None
    return float((len(stamps) - 1) / (stamps[-1] - stamps[0]))


def share(flags: Track, begin: float, end: float) -> float | None:
    """Return the percentage of the samples from `begin` to `end` (s) that are 1 rather than 0; None without samples."""
    _, values = flags.between(begin, end)
    return 100.0 * float(values.mean()) if len(values) else None
