"""Other six-axis filters on the same recordings, where their packages are installed: VQF (`vqf`), Madgwick and a textbook quaternion EKF (`ahrs`).

VQF with its default parameters; Madgwick with the gain its author gives for six axes; the EKF of `ahrs` with its defaults.
"""

import importlib.util
from collections.abc import Callable

import numpy as np

from gravcomp.orientation.inclination import inclination_rmse
from gravcomp.recordings.imu import Recording


def run_peers(recordings: dict[str, Recording], progress: Callable[[str], None]) -> dict:
    """Per filter the mean and each trial's inclination RMSE in degrees, or that it is not installed."""
    figures: dict = {}
    for name, (package, run) in PEERS.items():
        if importlib.util.find_spec(package) is None:
            figures[name] = f"not installed (pip install {package})"
            continue
        trials = {}
        for trial, recording in recordings.items():
            progress(f"{trial}, {name}")
            rmse = inclination_rmse(run(recording), recording.orientation, recording.movement)
            trials[trial] = round(float(np.degrees(rmse)), 4)
        figures[name] = {"mean": round(float(np.mean(list(trials.values()))), 4), "trials": trials}
    return figures


def _vqf(recording: Recording) -> np.ndarray:
    from vqf import VQF

    return VQF(1.0 / recording.rate).updateBatch(np.ascontiguousarray(recording.gyro), np.ascontiguousarray(recording.accel))[
        "quat6D"
    ]


def _madgwick(recording: Recording) -> np.ndarray:
    from ahrs.filters import Madgwick

    return Madgwick(gyr=recording.gyro, acc=recording.accel, frequency=recording.rate).Q


def _ekf(recording: Recording) -> np.ndarray:
    from ahrs.filters import EKF

    # Its 'NED' is the frame in which a specific force that points up is at rest.
    return EKF(gyr=recording.gyro, acc=recording.accel, frequency=recording.rate, frame="NED").Q


PEERS = {"vqf": ("vqf", _vqf), "madgwick": ("ahrs", _madgwick), "textbook_ekf": ("ahrs", _ekf)}
