"""What gaps in a recording leave: the error of the inclination after them, and how far the standard deviation is from it."""

from dataclasses import replace

import numpy as np

from gravcomp.orientation import estimate_recording
from gravcomp.orientation.inclination import inclination_error
from gravcomp.recordings.imu import Recording

GAPS = (0.3, 0.5, 0.7, 1.0)  # s
PLACES = (0.3, 0.55, 0.8)  # of the recording, where the gaps begin
TIMES = (0.0, 1.0, 5.0)  # s after the gap
WATCHED = 8.0  # s after a gap


def after_gaps(recording: Recording, gap: float) -> tuple[np.ndarray, float]:
    """Return the errors (places, times) in deg at TIMES after gaps of `gap` s, and the largest within WATCHED, over its std."""
    keep, begins = np.ones(len(recording), bool), []
    for place in PLACES:
        begin, missing = round(place * len(recording)), round(gap * recording.rate)
        keep[begin : begin + missing] = False
        begins.append(int(np.count_nonzero(keep[:begin])))
    names = ("stamp_ns", "gyro", "accel", "orientation", "movement")
    cut = replace(recording, **{name: getattr(recording, name)[keep] for name in names})
    result = estimate_recording(cut)
    assert cut.orientation is not None  # simulated recordings have ground truth
    error = inclination_error(result.orientation, cut.orientation)
    last = len(cut) - 1
    at = np.array([[min(begin + round(time * cut.rate), last) for time in TIMES] for begin in begins])
    watched = np.concatenate([np.arange(begin, min(begin + round(WATCHED * cut.rate), last)) for begin in begins])
    return np.degrees(error[at]), float(np.max(error[watched] / result.inclination_std[watched]))
