"""Topics of a bag as arrays, one row for each message."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gravcomp.recordings.bags.errors import BagError
from gravcomp.recordings.bags.rows import Rows, stamp_ns

VECTOR = "geometry_msgs/msg/Vector3Stamped"
POSE = "geometry_msgs/msg/PoseStamped"
SPECIFIC_FORCE = "sensor_msgs/msg/Imu"
CABLE_STATE = "gravcomp_msgs/msg/CableState"
CABLE_COMMAND = "gravcomp_msgs/msg/CableCommand"
CONTROLLER_STATUS = "gravcomp_msgs/msg/ControllerStatus"
SHAPE_TARGET = "gravcomp_msgs/msg/ShapeTarget"
_LEAST = 2  # messages of a topic that is needed


@dataclass(frozen=True)
class Wanted:
    """A topic of the type `kind` whose name ends with one of `names`, of which the first that is found counts.

    A name that begins with '/' is the full name. `optional`: the topic may be missing.
    """

    kind: str
    names: tuple[str, ...]
    optional: bool = False


@dataclass(frozen=True)
class Stream:
    """k messages in the order of their reception. The columns of `values` depend on the type: see `_VALUES`."""

    topic: str
    stamp: np.ndarray  # (k,) s, of the headers
    received: np.ndarray  # (k,) s
    values: np.ndarray  # (k, n)

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return (len(time), n): the values interpolated between the stamps; before and after them the first and the last row."""
        order = np.argsort(self.stamp, kind="stable")
        return np.column_stack([np.interp(time, self.stamp[order], column[order]) for column in self.values.T])


def read_streams(path: str | Path, wanted: Mapping[str, Wanted]) -> dict[str, Stream | None]:
    """Return the topics by the keys of `wanted`, None for an optional one that is missing or empty. A damaged bag is recovered.

    Raises BagError for a bag that cannot be read, for a topic that is missing, of another type or not unique, and for a topic
    that is not optional and has fewer than two messages.
    """
    from rosbags.rosbag2 import Reader

    from gravcomp.recordings.bags.decoding import UNREADABLE, decoded
    from gravcomp.recordings.bags.recovery import readable

    try:
        with Reader(readable(path).path) as reader:
            found = {c.topic: c.msgtype for c in reader.connections}
            topics = {key: _topic(path, found, want) for key, want in wanted.items()}
            rows = {topic: Rows() for topic in topics.values() if topic}
            for connection, received, raw in reader.messages([c for c in reader.connections if c.topic in rows]):
                message = decoded(connection, raw)
                rows[connection.topic].append(stamp_ns(message), received, _VALUES[connection.msgtype](message))
    except UNREADABLE as error:
        raise BagError(f"{path}: is not a readable bag: {error}") from error
    streams: dict[str, Stream | None] = {}
    for key, topic in topics.items():
        if topic is None or (wanted[key].optional and not len(rows[topic])):
            streams[key] = None
            continue
        if not wanted[key].optional and len(rows[topic]) < _LEAST:
            raise BagError(f"{path}: '{topic}' has {len(rows[topic])} messages; at least {_LEAST} are needed")
        streams[key] = _stream(path, topic, rows[topic])
    return streams


def _topic(path: str | Path, found: dict[str, str], want: Wanted) -> str | None:
    """Return the topic that `want` names among `found` (topic -> type). Raises BagError."""
    for name in want.names:
        if name.startswith("/") and name in found and found[name] != want.kind:
            raise BagError(f"{path}: '{name}' is {found[name]}; {want.kind} is needed")
        full = name if name.startswith("/") else f"/{name}"
        topics = [
            t for t, kind in found.items() if kind == want.kind and (t == name if name.startswith("/") else t.endswith(full))
        ]
        # The topic truth/gravity of the virtual robot is in a namespace below that of the robot's own gravity.
        spaces = sorted((topic[: len(topic) - len(full) + 1], topic) for topic in topics)
        if spaces and all(space.startswith(spaces[0][0]) for space, _ in spaces):
            return spaces[0][1]
        if topics:
            raise BagError(
                f"{path}: has several topics '{name}': {', '.join(sorted(topics))}; record one robot, or name the topic"
            )
    if want.optional:
        return None
    listed = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(found.items()))
    raise BagError(
        f"{path}: has no {want.kind} on {' or '.join(repr(name) for name in want.names)}; found: {listed or 'nothing'}"
    )


def _stream(path: str | Path, topic: str, rows: Rows) -> Stream:
    if not rows.even:
        raise BagError(f"{path}: the messages of '{topic}' have different numbers of values; those of one robot are needed")
    stamps, received, values = rows.arrays()
    return Stream(topic, 1e-9 * stamps, 1e-9 * received, values)


def _vector(v: Any) -> tuple[float, ...]:
    return v.x, v.y, v.z


def _pose(message: Any) -> tuple[float, ...]:
    """Return position, and orientation x y z w."""
    q = message.pose.orientation
    return *_vector(message.pose.position), q.x, q.y, q.z, q.w


def _shape_target(message: Any) -> tuple[float, ...]:
    """Return whether the target is a bend, its angle and plane, and position and direction of the tip."""
    return message.bend, message.bend_angle, message.bend_plane, *_vector(message.tip_position), *_vector(message.tip_direction)


_VALUES: dict[str, Callable[[Any], tuple[float, ...]]] = {
    VECTOR: lambda message: _vector(message.vector),
    POSE: _pose,
    SPECIFIC_FORCE: lambda message: _vector(message.linear_acceleration),
    CABLE_STATE: lambda message: tuple(message.displacement),
    CABLE_COMMAND: lambda message: tuple(message.displacement),
    CONTROLLER_STATUS: lambda message: (message.code,),
    SHAPE_TARGET: _shape_target,
}
