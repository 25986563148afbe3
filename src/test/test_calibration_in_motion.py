"""Scale and offset of the accelerometer from a sensor that is turned and shaken by hand."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.orientation.calibration_in_motion import calibrate_in_motion, calibrated
from gravcomp.orientation.errors import CalibrationError
from gravcomp.recordings.imu import Recording
from gravcomp.standard_gravity import STANDARD_GRAVITY

RATE = 100.0
SCALE, OFFSET = np.array([1.03, 0.98, 1.01]), np.array([0.2, -0.15, 0.1])


def by_hand(duration=60.0, turning=1.0, seed=1):
    """Return the recording of an ideal sensor that turns by up to `turning` (rad/s) about changing axes and moves by some cm."""
    chance = np.random.default_rng(seed)
    time = np.arange(int(duration * RATE)) / RATE
    rate = turning * np.stack([np.sin(0.31 * time + p) for p in chance.uniform(0.0, 6.0, 3)], axis=1)
    attitude = np.empty((len(time), 3, 3))
    now = np.eye(3)
    for k, turn in enumerate(Rotation.from_rotvec(rate / RATE).as_matrix()):
        attitude[k] = now
        now = now @ turn
    moved = np.stack([2.0 * np.sin(3.0 * time + p) for p in (0.0, 1.0, 2.0)], axis=1)  # m/s^2
    accel = np.einsum("kji,kj->ki", attitude, moved + np.array([0.0, 0.0, STANDARD_GRAVITY])) + 0.02 * chance.standard_normal(
        (len(time), 3)
    )
    return Recording("hand", np.rint(time * 1e9).astype(np.int64), rate, accel)


@pytest.mark.parametrize("seed", [1, 2])
def test_scale_and_offset_are_found_in_motion(seed):
    true = by_hand(seed=seed)
    wrong = dataclasses.replace(true, accel=true.accel / SCALE + OFFSET)
    found = calibrate_in_motion(wrong)
    assert found.accel_scale == pytest.approx(tuple(SCALE), abs=0.02)
    assert found.accel_offset == pytest.approx(tuple(OFFSET), abs=0.08)
    assert rms(calibrated(wrong, found).accel - true.accel) < 0.3 * rms(wrong.accel - true.accel)


def rms(values):
    return np.sqrt(np.mean(values**2))


def test_a_good_sensor_is_left_as_it_is():
    found = calibrate_in_motion(by_hand())
    assert found.accel_scale == pytest.approx((1.0, 1.0, 1.0), abs=0.02) and found.accel_offset == pytest.approx(
        (0.0, 0.0, 0.0), abs=0.08
    )


def test_too_little_motion_is_refused():
    with pytest.raises(CalibrationError, match=r"determines the offset .* to 0\.\d\d m/s\^2 only; turn the sensor slowly"):
        calibrate_in_motion(by_hand(turning=0.01))
    with pytest.raises(CalibrationError, match=r"has 10 s; 20 s in motion are needed"):
        calibrate_in_motion(by_hand(duration=10.0))
