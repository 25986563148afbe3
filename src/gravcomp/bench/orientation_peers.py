"""Other six-axis filters on the same recordings, if their packages are installed.

VQF (`vqf`) with its default parameters; Madgwick (`ahrs`) with its author's gain for six axes; a textbook quaternion EKF (`ahrs`)
with its defaults.
"""

import importlib.util
from collections.abc import Callable

import numpy as np

from gravcomp.bench.inclination_error import rmse_deg
from gravcomp.recordings.imu import Recording


def run_peers(recordings: dict[str, Recording], progress: Callable[[str], None]) -> dict:
    """Return the inclination RMSE (deg) of each filter, mean and by trial, or a note that it is not installed."""
    figures: dict = {}
    for name, (package, run) in PEERS.items():
        if importlib.util.find_spec(package) is None:
            figures[name] = f"not installed (pip install {package})"
            continue
        trials = {}
        for trial, recording in recordings.items():
            progress(f"{trial}, {name}")
            trials[trial] = rmse_deg(run(recording), recording)
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

    # In its frame 'NED' the specific force at rest points up.
    return EKF(gyr=recording.gyro, acc=recording.accel, frequency=recording.rate, frame="NED").Q


PEERS = {"vqf": ("vqf", _vqf), "madgwick": ("ahrs", _madgwick), "textbook_ekf": ("ahrs", _ekf)}
