"""The figures of a run: sag without compensation, what is left with it, and how well the model knew.

sag: mean distance of the true tip from the straight robot's, cables released and come to rest.
residual: root mean square of the true tip's distance from the target across (lateral) and along (axial) the target's direction.
correlation: Pearson's r between modelled and true tip over time, the three coordinates centred and taken together.
"""

import numpy as np

from gravcomp.evaluation.track import Track


def sag(truth_tip: Track, straight: np.ndarray, begin: float, end: float) -> float | None:
    """Metres; None without samples."""
    _, tip = truth_tip.between(begin, end)
    return float(np.linalg.norm(tip - straight, axis=1).mean()) if len(tip) else None


def residual(truth_tip: Track, target: np.ndarray, direction: np.ndarray, begin: float, end: float) -> tuple[float, float] | None:
    """(lateral, axial) RMS in metres; None without samples."""
    _, tip = truth_tip.between(begin, end)
    if not len(tip):
        return None
    axial = (tip - target) @ direction
    lateral = tip - target - axial[:, None] * direction
    return float(np.sqrt((lateral**2).sum(axis=1).mean())), float(np.sqrt((axial**2).mean()))


def correlation(truth_tip: Track, model_tip: Track, begin: float, end: float) -> float | None:
    """None without common samples or when nothing moved."""
    stamps, truth = truth_tip.between(begin, end)
    model = model_tip.at(stamps)
    both = np.isfinite(model).all(axis=1)
    if both.sum() < 2:
        return None
    a, b = truth[both] - truth[both].mean(axis=0), model[both] - model[both].mean(axis=0)
    scale = np.sqrt((a**2).sum() * (b**2).sum())
    return float((a * b).sum() / scale) if scale > 1e-12 else None


def gravity_error(truth: Track, estimate: Track, begin: float, end: float) -> float | None:
    """RMS angle in rad between the true and the estimated gravity; None without common samples."""
    stamps, true = truth.between(begin, end)
    own = estimate.at(stamps)
    both = np.isfinite(own).all(axis=1)
    if not both.any():
        return None
    a, b = true[both], own[both]
    cross = np.linalg.norm(np.cross(a, b), axis=1)
    return float(np.sqrt((np.arctan2(cross, (a * b).sum(axis=1)) ** 2).mean()))


def rate(stamps: np.ndarray) -> float | None:
    """Samples a second between the first and the last stamp."""
    if len(stamps) < 2 or stamps[-1] <= stamps[0]:
        return None
    return float((len(stamps) - 1) / (stamps[-1] - stamps[0]))
