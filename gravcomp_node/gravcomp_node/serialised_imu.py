"""A sample read from a serialised sensor_msgs/Imu, and written into one.

rclpy makes an Imu with its seven parts, three of them arrays, and takes ten times as long for it as for reading the seven
numbers that a filter needs: a tenth of the loop's latency, where samples come to a process with cold caches. Publishing one takes
twice as long as publishing its bytes. An encoding other than the usual one (gravcomp_node.cdr) is left to rclpy.
"""

import struct
from collections.abc import Sequence

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu

from gravcomp_node import cdr

_STAMP = struct.Struct("<iI")
_VECTOR = struct.Struct("<3d")
_ORIENTATION, _COVARIANCE = 4 * 8, 9 * 8

Vector = tuple[float, float, float]


def _places(name: int) -> tuple[int, int]:
    """Return where rate and specific force are, for a frame's name of `name` bytes with its final zero."""
    end = cdr.HEAD.size + name
    rate_at = cdr.BODY + end + -end % 8 + _ORIENTATION + _COVARIANCE
    return rate_at, rate_at + _VECTOR.size + _COVARIANCE


def read_sample(data: bytes) -> tuple[int, Vector, Vector]:
    """Return stamp in ns, angular rate (3,) in rad/s, specific force (3,) in m/s^2. Raises ValueError for a damaged message."""
    if data[:2] != cdr.LITTLE_ENDIAN:
        try:
            message = deserialize_message(data, Imu)
        except RuntimeError as error:
            raise ValueError(f"a serialised sensor_msgs/Imu of {len(data)} bytes cannot be read: {error}") from error
        stamp, rate, force = message.header.stamp, message.angular_velocity, message.linear_acceleration
        return stamp.sec * 1_000_000_000 + stamp.nanosec, (rate.x, rate.y, rate.z), (force.x, force.y, force.z)
    try:
        sec, nanosec, name = cdr.HEAD.unpack_from(data, cdr.BODY)
        rate_at, force_at = _places(name)
        rate = _VECTOR.unpack_from(data, rate_at)
        force = _VECTOR.unpack_from(data, force_at)
    except struct.error as error:
        raise ValueError(f"a serialised sensor_msgs/Imu of {len(data)} bytes is cut: {error}") from error
    return sec * 1_000_000_000 + nanosec, rate, force


class SampleWriter:
    """Writes samples of a frame as serialised Imu messages without orientation, whose covariances are not known."""

    def __init__(self, frame: str):
        """frame: name of the IMU's frame."""
        self._data = cdr.written_head(0, 0, frame)
        self._rate_at, self._force_at = _places(len(frame.encode()) + 1)
        cdr.pad(self._data, 8)
        covariance = [0.0] * 9
        no_orientation = [-1.0, *covariance[1:]]  # sensor_msgs/Imu
        self._data += struct.pack("<37d", 0.0, 0.0, 0.0, 1.0, *no_orientation, *[0.0] * 3, *covariance, *[0.0] * 3, *covariance)

    def write(self, stamp_ns: int, rate: Sequence[float], force: Sequence[float]) -> bytes:
        """Return the message of a sample: stamp in ns, angular rate (3,) in rad/s, specific force (3,) in m/s^2."""
        _STAMP.pack_into(self._data, cdr.BODY, *divmod(stamp_ns, 1_000_000_000))
        _VECTOR.pack_into(self._data, self._rate_at, *rate)
        _VECTOR.pack_into(self._data, self._force_at, *force)
        return bytes(self._data)
