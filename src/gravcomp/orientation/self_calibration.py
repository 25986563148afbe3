"""Calibration of the accelerometer from a recording that was not made for it: what its motion shows, and what it leaves open.

A sensor that turns far enough shows scale and offset of all axes (`calibration_in_motion`). One that hardly turns shows the
length of gravity at rest only, in the directions in which it rests: an offset across them tilts gravity and stays unknown.
"""

import math

from gravcomp.orientation.calibration import OFFSET_PRIOR, fit_accelerometer
from gravcomp.orientation.calibration_in_motion import KNOWN, calibrate_in_motion
from gravcomp.orientation.errors import CalibrationError
from gravcomp.orientation.imu_calibration import ImuCalibration
from gravcomp.orientation.options import FilterOptions
from gravcomp.orientation.resting_poses import resting_poses
from gravcomp.recordings.imu import Recording


def calibrate_from_itself(recording: Recording, options: FilterOptions | None = None) -> tuple[ImuCalibration, str]:
    """Return scale and offset of the accelerometer, and a sentence on what the recording leaves open; empty: nothing.

    Raises CalibrationError where the sensor neither turns nor rests.
    """
    options = options or FilterOptions()
    try:
        return calibrate_in_motion(recording, options.gravity), ""
    except CalibrationError as motion:
        try:
            poses = resting_poses(recording, options)
        except CalibrationError:
            raise motion from None
    fit = fit_accelerometer(poses, options.gravity)
    open_axes = [axis for axis, std in zip("xyz", fit.offset_std) if std > KNOWN * OFFSET_PRIOR]
    tilt = math.degrees(OFFSET_PRIOR / options.gravity)
    sentence = (
        f"the sensor turns too little to calibrate the offset along {', '.join(open_axes)}: only the length of gravity at rest is"
        f" corrected, and an offset of {OFFSET_PRIOR:g} m/s^2 would still tilt gravity by {tilt:.1f} deg"
    )
    return ImuCalibration(tuple(fit.scale.tolist()), tuple(fit.offset.tolist())), sentence if open_axes else ""
