"""Joint positions and the URDF of an arm in a bag."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gravcomp.recordings.bags.errors import BagError
from gravcomp.recordings.bags.rows import stamp_ns

_JOINTS = "sensor_msgs/msg/JointState"
_TEXT = "std_msgs/msg/String"
_SHOWN = 12


def read_description(path: str | Path) -> str | None:
    """Return the last text on a topic that ends with robot_description, or None. Raises BagError."""
    text = None
    for _, message in _messages(path, _TEXT, lambda topic: topic.endswith("robot_description")):
        text = message.data
    return text


def read_joint_positions(path: str | Path, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return stamps (k,) in ns and positions (k, n) in rad or m of the named joints, from the first time that all are known.

    The joints may come in several messages and on several topics. A stamp of zero is replaced by the time of reception. Raises
    BagError for a bag that cannot be read, and where a joint is missing; the error names the joints that are there.
    """
    last: dict[str, float] = {}
    stamps, rows = [], []
    seen: set[str] = set()
    for received, message in _messages(path, _JOINTS, lambda _: True):
        seen.update(message.name)
        if len(message.name) != len(message.position):
            continue
        last.update((name, x) for name, x in zip(message.name, message.position) if name in names and np.isfinite(x))
        if len(last) == len(names):
            stamps.append(stamp_ns(message) or received)
            rows.append([last[name] for name in names])
    if not rows:
        missing = ", ".join(name for name in names if name not in last)
        there = ", ".join(sorted(seen)[:_SHOWN]) or "none"
        raise BagError(f"{path}: has no positions of the joints {missing}; its joint states have: {there}")
    order = np.argsort(stamps, kind="stable")
    return np.array(stamps)[order], np.array(rows)[order]


def _messages(path: str | Path, kind: str, wanted: Any) -> Any:
    """Yield the time of reception (ns) and the message of each message of a type, on the wanted topics. Raises BagError."""
    from rosbags.rosbag2 import Reader

    from gravcomp.recordings.bags.decoding import UNREADABLE, decoded
    from gravcomp.recordings.bags.recovery import readable

    try:
        with Reader(readable(path).path) as reader:
            chosen = [c for c in reader.connections if c.msgtype == kind and wanted(c.topic)]
            for connection, received, raw in reader.messages(chosen) if chosen else ():
                yield received, decoded(connection, raw)
    except UNREADABLE as error:
        raise BagError(f"{path}: is not a readable bag: {error}") from error
