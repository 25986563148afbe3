"""Measured tips from a rosbag2 folder: poses, with `gravity`, `cable/state` and `imu/data` interpolated to their times."""

from pathlib import Path

import numpy as np

from gravcomp.calibration.measured import Measured, MeasurementError
from gravcomp.recordings.bags import BagError
from gravcomp.recordings.bags.streams import CABLE_STATE, POSE, SPECIFIC_FORCE, VECTOR, Stream, Wanted, read_streams
from gravcomp.tip_observer.causes import is_since_boot

TIP_TOPICS = ("measured/tip", "truth/tip")
"""Topics of a tracker and of the virtual robot."""

SAME_CLOCK = 1.0
"""Seconds by which the stamps of tips and gravity may differ."""

_LONGEST_GAP = 1.0  # s: a new trial begins after a longer time without tips
_RATE = 50.0  # Hz: rate of the samples that are kept


def read_bag(path: Path, cables: tuple[str, ...], tip_topic: str | None = None) -> Measured:
    """Return the measurement in a bag. Raises MeasurementError."""
    wanted = {
        "gravity": Wanted(VECTOR, ("gravity",)),
        "state": Wanted(CABLE_STATE, ("cable/state",)),
        "tip": Wanted(POSE, (tip_topic,) if tip_topic else TIP_TOPICS),
        "force": Wanted(SPECIFIC_FORCE, ("imu/data",), optional=True),
    }
    try:
        streams = read_streams(path, wanted)
    except BagError as error:
        raise MeasurementError(str(error)) from error
    gravity, state, tip, force = (streams[key] for key in wanted)
    assert gravity is not None and state is not None and tip is not None  # none of them is optional
    if state.values.shape[1] != len(cables):
        raise MeasurementError(f"{path}: '{state.topic}' has {state.values.shape[1]} cables; the robot has {len(cables)}")
    for stream in (gravity, state, tip):
        if not np.isfinite(stream.values).all():
            raise MeasurementError(f"{path}: '{stream.topic}' has values that are not finite numbers")
    _check_clock(path, gravity, tip)
    order = np.argsort(tip.stamp, kind="stable")
    time, poses = tip.stamp[order], tip.values[order]
    keep = thinned(time, _RATE)
    keep &= (time >= max(gravity.stamp.min(), state.stamp.min())) & (time <= min(gravity.stamp.max(), state.stamp.max()))
    time, poses = time[keep], poses[keep]
    if len(time) < 2:
        raise MeasurementError(f"{path}: tips, gravity and cable states do not overlap in time")
    return Measured(
        source=str(path),
        trial=np.concatenate([[0], np.cumsum(np.diff(time) > _LONGEST_GAP)]),
        time=time - time[0],
        gravity=gravity.at(time),
        displacement=state.at(time),
        tip_position=poses[:, :3],
        tip_direction=_directions(path, tip.topic, poses),
        specific_force=None if force is None else np.linalg.norm(force.at(time), axis=1),
    )


def _check_clock(path: Path, gravity: Stream, tip: Stream) -> None:
    """Raise MeasurementError where the tips are stamped by another clock than gravity."""
    late, gravity_late = (float(np.median(stream.received - stream.stamp)) for stream in (tip, gravity))
    if abs(late - gravity_late) <= SAME_CLOCK:
        return
    raise MeasurementError(f"{path}: {another_clock(gravity_late - late, float(np.median(tip.stamp)), tip.topic)}")


def another_clock(ahead: float, stamp: float, topic: str) -> str:
    """Return the sentence about tips whose stamps, one of which is `stamp` s, are `ahead` s of those of gravity."""
    if stamp == 0.0:
        return f"the stamps of '{topic}' are empty; the tracker has to give the time of each measurement"
    side = "ahead of" if ahead > 0.0 else "behind"
    boot = " (do they count from the start of a machine?)" if is_since_boot(stamp, stamp - ahead) else ""
    return (
        f"the stamps of '{topic}' are {abs(ahead):.4g} s {side} those of gravity{boot}; synchronise the tracker's clock with the"
        " robot's"
    )


def thinned(time: np.ndarray, rate: float) -> np.ndarray:
    """Return (k,) which of the increasing times (k,) to keep for at most `rate` samples per second."""
    return np.concatenate([[True], np.diff(np.floor(time * rate)) > 0])


def _directions(path: Path, topic: str, poses: np.ndarray) -> np.ndarray | None:
    """Return the directions (k, 3) of poses (k, 7); None where the tracker leaves the orientation empty."""
    empty = np.linalg.norm(poses[:, 3:], axis=1) < 1e-6
    if empty.all():
        return None
    if empty.any():
        raise MeasurementError(f"{path}: '{topic}' has {empty.sum()} poses whose orientation is no quaternion: all zero")
    return direction_of_poses(poses)


def direction_of_poses(poses: np.ndarray) -> np.ndarray:
    """Return the z axes (k, 3) of poses (k, 7), position and orientation x y z w."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(poses[:, 3:]).as_matrix()[:, :, 2]
