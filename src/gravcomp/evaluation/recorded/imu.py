"""Yaw drift of a recorded IMU at rest: with the orientation filter, and from the integrated raw rate."""

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.evaluation.recorded.run import RecordedRun
from gravcomp.orientation import GravityEstimator, estimate_recording
from gravcomp.orientation import quaternion as quat
from gravcomp.recordings.imu import Recording, read_recording
from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Result

_REST = 20.0  # s at the start in which the filter learns the bias
_SHORTEST = 60.0  # s
_TURNING = np.radians(3.0)  # rad/s, largest rate at rest
_WINDOW = 30.0  # s; the article reports 20 deg in this time


def run(recorded: RecordedRun) -> Result:
    """Return the evaluation. Raises ConfigError for a recording that is too short or not at rest."""
    recording = read_recording(recorded.bag)
    if recording.duration < _SHORTEST:
        raise ConfigError(
            f"{recorded.bag}: has {recording.duration:.0f} s of IMU samples; at least {_SHORTEST:g} s at rest are needed"
        )
    turning = float(np.nanpercentile(np.linalg.norm(recording.gyro, axis=1), 90))
    if turning > _TURNING:
        raise ConfigError(
            f"{recorded.bag}: the IMU rotates at {np.degrees(turning):.1f} deg/s; the true yaw is known only at rest"
        )
    time = 1e-9 * (recording.stamp_ns - recording.stamp_ns[0])
    estimated = estimate_recording(recording, GravityEstimator(recorded.setup.estimator.estimator)).orientation
    yaw = {"with filter": _yaw(estimated), "raw rate integrated": _yaw(_integrated(recording, estimated))}
    after = time >= _REST
    drift = {name: values[after] - values[after][0] for name, values in yaw.items()}
    rate = recording.rate
    figures = [
        Figure("yaw drift at rest, with filter", float(np.abs(drift["with filter"]).max()), "deg", limit=1.0),
        Figure("yaw drift at rest, raw rate integrated", float(np.abs(drift["raw rate integrated"]).max()), "deg"),
    ]
    figures += [
        Figure(
            f"the same within {_WINDOW:g} s, {name}",
            _within(values, round(_WINDOW * rate)),
            "deg",
            "wanders about 20 deg in 30 s" if "raw" in name else "",
        )
        for name, values in drift.items()
    ]
    if recording.temperature is not None and len(recording.temperature):
        figures.append(Figure("temperature of the chip, deviation", float(np.std(recording.temperature)), "degC"))
    return Result(
        name="imu-ablation",
        title="IMU at rest, recorded",
        question="How much does the yaw drift at rest, with and without the filter?",
        ground=f"A recording of the IMU at rest, {recorded.bag.name}, through the filter offline with the robot's parameters;"
        f" yaw from {_REST:g} s on.",
        figures=figures,
        parts=[Plot("Yaw drift", _drawing(time[after], drift), "Left: with the filter; right: without; the scales differ.")],
        parameters={"bag": str(recorded.bag), "seconds": recording.duration, "rate_hz": rate},
    )


def _integrated(recording: Recording, estimated: np.ndarray) -> np.ndarray:
    """Return (n, 4) w x y z: the first of the estimated orientations (n, 4), rotated by the raw rates."""
    start = int(np.argmax(np.isfinite(estimated).all(axis=1)))
    w, x, y, z = estimated[start].tolist()
    orientation = (w, x, y, z)
    rows = [orientation] * (start + 1)
    steps = np.diff(recording.stamp_ns[start:]) * 1e-9
    for gyro, step in zip(np.nan_to_num(recording.gyro[start + 1 :]).tolist(), steps.tolist()):
        orientation = quat.normalised(quat.multiply(orientation, quat.exponential(*(w * step for w in gyro))))
        rows.append(orientation)
    return np.array(rows)


def _yaw(orientation: np.ndarray) -> np.ndarray:
    """Return the rotation (n,) in deg about the vertical of the orientations (n, 4), without jumps."""
    w, _, _, z = np.nan_to_num(orientation).T
    return np.degrees(np.unwrap(2.0 * np.arctan2(z, w)))


def _within(values: np.ndarray, step: int) -> float:
    """Return the largest change of the values (n,) over `step` samples."""
    step = min(step, len(values) - 1)
    return float(np.abs(values[step:] - values[:-step]).max())


def _drawing(time: np.ndarray, drift: dict[str, np.ndarray]) -> str:
    with Drawing(1, 2, width=10.5, height=3.0) as drawing:
        for axes, (name, values), colour in zip(drawing.axes, drift.items(), (REAL, MODEL)):
            axes.plot(time / 60.0, values, color=colour)
            axes.set_title(name)
            axes.set_xlabel("time in min")
            axes.set_ylabel("yaw drift in deg")
    return drawing.svg
