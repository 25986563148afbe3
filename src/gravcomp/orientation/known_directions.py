"""Whether measured directions fit known ones: a wrong order, a wrong robot and a negated accelerometer do not.

A rotation cannot invert directions that span the space, so with three of them a negated accelerometer shows. Directions in one
plane are inverted by half a turn about its normal: they fit with both signs.
"""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.orientation.errors import CalibrationError
from gravcomp.orientation.resting_poses import DISTINCT


def check_directions(measured: np.ndarray, known: np.ndarray) -> None:
    """Raise CalibrationError where no rotation turns the measured directions (k, 3) into the known ones (k, 3) within 15 deg."""
    missed = _missed(measured, known)
    if missed.max() <= DISTINCT:
        return
    if _missed(-measured, known).max() <= DISTINCT:
        raise CalibrationError(
            "the accelerometer is negated, or its axes are left-handed: the directions of the poses fit only if they are"
            " inverted. The specific force (up at rest) is needed"
        )
    worst = int(missed.argmax())
    raise CalibrationError(
        f"no mount fits the poses: pose {worst + 1} of {len(missed)} is off by {math.degrees(missed[worst]):.0f} deg, at most"
        f" {math.degrees(DISTINCT):.0f} deg are allowed. Are the directions those of this recording, and in its order?"
    )


def show_sign(known: np.ndarray) -> bool:
    """Return whether known directions (k, 3) span the space, so that a negated accelerometer shows."""
    return len(known) >= 3 and bool(np.linalg.svd(known, compute_uv=False)[2] > 2.0 * math.sin(DISTINCT))


def _missed(measured: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the angles (k,) in rad that the best rotation leaves."""
    rotation, _ = Rotation.align_vectors(known, measured)
    turned = rotation.apply(measured)
    return np.arctan2(np.linalg.norm(np.cross(turned, known), axis=1), np.sum(turned * known, axis=1))
