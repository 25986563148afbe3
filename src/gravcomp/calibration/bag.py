"""Measured tips from a rosbag2 folder: `gravity`, `cable/state` and the tip's poses, brought to the tip's times."""

from pathlib import Path

import numpy as np

from gravcomp.bags import BagError
from gravcomp.bags.recovery import readable
from gravcomp.calibration.measured import Measured, MeasurementError

_GRAVITY = "geometry_msgs/msg/Vector3Stamped"
_STATE = "gravcomp_msgs/msg/CableState"
_POSE = "geometry_msgs/msg/PoseStamped"
_TIP_TOPICS = ("measured/tip", "truth/tip")
_LONGEST_GAP = 1.0  # s without tips: a new trial begins
_RATE = 50.0  # Hz that are kept


def read_bag(path: Path, cables: tuple[str, ...], tip_topic: str | None = None) -> Measured:
    """The bag's measurement. Raises MeasurementError."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.rosbag2 import ReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_typestore
    from scipy.spatial.transform import Rotation

    try:
        with AnyReader([readable(path).path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            found = {c.topic: c.msgtype for c in reader.connections}
            gravity, state = _only(path, found, _GRAVITY, ("gravity",)), _only(path, found, _STATE, ("cable/state",))
            tip = tip_topic or _only(path, found, _POSE, _TIP_TOPICS)
            if found.get(tip) != _POSE:
                raise MeasurementError(f"{path}: '{tip}' is {found.get(tip, 'not in it')}; {_POSE} is needed")
            rows: dict[str, list] = {gravity: [], state: [], tip: []}
            for connection, _, raw in reader.messages([c for c in reader.connections if c.topic in rows]):
                message = reader.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
                rows[connection.topic].append((stamp, _values(message)))
    except (BagError, AnyReaderError, ReaderError, SerdeError, OSError, KeyError) as error:
        raise MeasurementError(f"{path}: is not a readable bag: {error}") from error
    for topic, values in rows.items():
        if len(values) < 2:
            raise MeasurementError(f"{path}: '{topic}' holds {len(values)} messages; at least 2 are needed")
    time, poses = _columns(rows[tip])
    keep = np.concatenate([[True], np.diff(np.floor(time * _RATE)) > 0])
    time, poses = time[keep], poses[keep]
    gravity_time, gravity_values = _columns(rows[gravity])
    state_time, displacement = _columns(rows[state])
    if displacement.shape[1] != len(cables):
        raise MeasurementError(f"{path}: '{state}' has {displacement.shape[1]} cables; the robot has {len(cables)}")
    inside = (time >= max(gravity_time[0], state_time[0])) & (time <= min(gravity_time[-1], state_time[-1]))
    time, poses = time[inside], poses[inside]
    if len(time) < 2:
        raise MeasurementError(f"{path}: tips, gravity and cable states do not overlap in time")
    return Measured(
        source=str(path),
        trial=np.concatenate([[0], np.cumsum(np.diff(time) > _LONGEST_GAP)]),
        time=time - time[0],
        gravity=_at(time, gravity_time, gravity_values),
        displacement=_at(time, state_time, displacement),
        tip_position=poses[:, :3],
        tip_direction=Rotation.from_quat(poses[:, 3:]).as_matrix()[:, :, 2],
    )


def _only(path: Path, found: dict[str, str], kind: str, names: tuple[str, ...]) -> str:
    """The topic of this type whose name ends so; names earlier in the tuple go first."""
    for name in names:
        topics = [topic for topic, msgtype in found.items() if msgtype == kind and topic.endswith(f"/{name}")]
        if len(topics) == 1:
            return topics[0]
        if topics:
            raise MeasurementError(f"{path}: has several topics '{name}': {', '.join(sorted(topics))}; record one robot, or name the tip's topic")
    listed = ", ".join(f"{topic} ({msgtype})" for topic, msgtype in sorted(found.items()))
    raise MeasurementError(f"{path}: has no {kind} on '{names[0]}'; found: {listed}")


def _values(message) -> tuple[float, ...]:
    if message.__msgtype__ == _GRAVITY:
        return message.vector.x, message.vector.y, message.vector.z
    if message.__msgtype__ == _STATE:
        return tuple(message.displacement)
    p, q = message.pose.position, message.pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _columns(rows: list) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) increasing, values (k, ...)."""
    time = np.array([row[0] for row in rows])
    order = np.argsort(time, kind="stable")
    return time[order], np.array([row[1] for row in rows], dtype=float)[order]


def _at(time: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(time, known, values[:, k]) for k in range(values.shape[1])])
