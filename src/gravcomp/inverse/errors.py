"""Error of an effector to its target: distance, lateral and axial error and tilt of the tip, and distance of the backbone."""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.inverse.programme import tip_axis
from gravcomp.inverse.target import Target


class TipErrors(NamedTuple):
    """Errors of the tip: distance, lateral (across the axis of `tip_axis`) and axial (along it, signed) in m; tilt in rad."""

    distance: float
    lateral: float
    axial: float
    tilt: float


@njit(cache=True)
def tip_errors(effector: np.ndarray, tip: np.ndarray, direction: np.ndarray) -> TipErrors:
    """Return the errors of the tip.

    effector (e,): rows 0 to 2 are the tip's position, 3 to 5 its direction; tip (3,) and direction (3,) of the target, zeros
    for no direction.
    """
    axis = tip_axis(effector, direction)
    distance, axial, across, chord = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        distance += (effector[i] - tip[i]) ** 2
        axial += (effector[i] - tip[i]) * axis[i]
    length = np.sqrt(effector[3] ** 2 + effector[4] ** 2 + effector[5] ** 2)
    for i in range(3):
        across += (effector[i] - tip[i] - axial * axis[i]) ** 2
        chord += (effector[3 + i] / length - axis[i]) ** 2
    # The angle from its chord is accurate for small angles; arccos is not.
    return TipErrors(np.sqrt(distance), np.sqrt(across), axial, 2.0 * np.arcsin(min(1.0, 0.5 * np.sqrt(chord))))


def backbone_missed(effector: np.ndarray, target: Target, backbone_station: np.ndarray) -> float:
    """Return the largest distance in m of a weighted backbone point from its target, 0 without any."""
    if not target.backbone_weight.size:
        return 0.0
    used = target.backbone_weight > 0.0
    if not used.any():
        return 0.0
    points = effector[6:].reshape(-1, 3)
    reached = np.stack([np.interp(target.backbone_station[used], backbone_station, points[:, k]) for k in range(3)], axis=1)
    return float(np.linalg.norm(reached - target.backbone_position[used], axis=1).max())
