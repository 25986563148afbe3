"""Reading of the IMU stream of a rosbag2 folder (MCAP or SQLite); a damaged one is recovered.

It has one sensor_msgs/Imu topic (of several the one that ends with `imu/data_raw`), the sensor_msgs/Temperature of the same
namespace and, as ground truth, `virtual/base_orientation` (geometry_msgs/QuaternionStamped). Stamps are those of the headers;
`stamps.py` repairs those that cannot be used.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gravcomp.recordings.bags.rows import Rows, stamp_ns
from gravcomp.recordings.imu.recording import Recording, RecordingError
from gravcomp.recordings.imu.stamps import nearest, usable_stamps

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

IMU = "sensor_msgs/msg/Imu"
TEMPERATURE = "sensor_msgs/msg/Temperature"
TRUTH = "geometry_msgs/msg/QuaternionStamped"
_CHECKED = 0.5  # share of the search for damage in the time to read a bag
_REPORTED = 1000  # messages between two reports of progress


def read_rosbag(path: str | Path, topic: str | None = None, progress: Callable[[float], None] | None = None) -> Recording:
    """Return the IMU stream in the folder; `topic` names one of several; `progress` receives the share that is read.

    All messages are read once, to find damage, and those of the IMU once more; only the values of the IMU are kept. Raises
    RecordingError.
    """
    from rosbags.rosbag2 import Reader

    from gravcomp.recordings.bags import BagError
    from gravcomp.recordings.bags.decoding import UNREADABLE, decoded
    from gravcomp.recordings.bags.recovery import readable, share_read

    path = Path(path)
    try:
        whole = readable(path, (lambda done: progress(_CHECKED * done)) if progress else None)
    except BagError as error:
        raise RecordingError(str(error)) from error
    damage = (f"damaged ({whole.problem}): read up to the damage, {whole.messages} messages",) if whole.problem else ()
    try:
        with Reader(whole.path) as reader:
            name = _choose(reader.connections, topic, path)
            prefix = name[: -len("imu/data_raw")] if name.endswith("imu/data_raw") else name.rsplit("/", 1)[0] + "/"
            temperatures = [c.topic for c in reader.connections if c.msgtype == TEMPERATURE and c.topic.startswith(prefix)]
            truths = [
                c.topic for c in reader.connections if c.msgtype == TRUTH and c.topic == f"{prefix}virtual/base_orientation"
            ]
            rows = {t: Rows(width) for t, width in ((name, 6), *((t, 1) for t in temperatures[:1]), *((t, 4) for t in truths))}
            for i, (connection, received, raw) in enumerate(reader.messages([c for c in reader.connections if c.topic in rows])):
                if progress is not None and i % _REPORTED == 0:
                    progress(_CHECKED + (1.0 - _CHECKED) * share_read(reader, received))
                message = decoded(connection, raw)
                rows[connection.topic].append(stamp_ns(message), received, _values(message))
    except (*UNREADABLE, ValueError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{path}: is not a readable rosbag2 recording: {error}") from error

    recorded, receptions, values = rows[name].arrays()
    samples, notes = usable_stamps(recorded, receptions, values)
    temperature = rows[temperatures[0]].arrays() if temperatures else None
    truth = rows[truths[0]].arrays() if truths else None
    return Recording(
        source=str(path),
        stamp_ns=samples,
        gyro=values[:, :3],
        accel=values[:, 3:],
        temperature_stamp_ns=temperature[0] if temperature else None,
        temperature=temperature[2][:, 0] if temperature else None,
        orientation=nearest(samples, truth[0], truth[2]) if truth and len(truth[0]) else None,
        notes=(*damage, *notes),
    )


def _choose(connections: "Sequence[Connection]", topic: str | None, path: Path) -> str:
    found = sorted({c.topic for c in connections if c.msgtype == IMU})
    if topic is not None:
        if topic not in found:
            raise RecordingError(f"{path}: has no {IMU} on '{topic}'; found: {', '.join(found) or 'none'}")
        return topic
    raw = [name for name in found if name.endswith("imu/data_raw")]
    if len(raw) == 1:
        return raw[0]
    if len(found) == 1:
        return found[0]
    if not found:
        raise RecordingError(f"{path}: has no topic of type {IMU}; found: {', '.join(sorted({c.topic for c in connections}))}")
    raise RecordingError(f"{path}: has several topics of type {IMU}: {', '.join(found)}; name one of them")


def _values(message: Any) -> tuple[float, ...]:
    if message.__msgtype__ == IMU:
        gyro, accel = message.angular_velocity, message.linear_acceleration
        return gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z
    if message.__msgtype__ == TEMPERATURE:
        return (message.temperature,)
    q = message.quaternion
    return q.w, q.x, q.y, q.z
