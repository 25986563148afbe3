"""A sample read from a serialised sensor_msgs/Imu.

rclpy makes an Imu with its seven parts, three of them arrays, and takes ten times as long for it as for reading the seven
numbers that a filter needs: a tenth of the loop's latency, where samples come to a process with cold caches.

The layout is that of CDR (OMG DDS-XTypes 1.3, 7.4.1): each number at a multiple of its size, counted after the four bytes that
name the encoding. An encoding other than the little-endian one of all middlewares on usual computers is left to rclpy.
"""

import struct

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu

_LITTLE_ENDIAN = b"\x00\x01"
_BODY = 4  # bytes before it
_HEAD = struct.Struct("<iII")  # s, ns, length of the frame's name with its final zero
_VECTOR = struct.Struct("<3d")
_ORIENTATION, _COVARIANCE = 4 * 8, 9 * 8

Vector = tuple[float, float, float]


def read_sample(data: bytes) -> tuple[int, Vector, Vector]:
    """Return stamp in ns, angular rate (3,) in rad/s, specific force (3,) in m/s^2. Raises ValueError for a damaged message."""
    if data[:2] != _LITTLE_ENDIAN:
        try:
            message = deserialize_message(data, Imu)
        except RuntimeError as error:
            raise ValueError(f"a serialised sensor_msgs/Imu of {len(data)} bytes cannot be read: {error}") from error
        stamp, rate, force = message.header.stamp, message.angular_velocity, message.linear_acceleration
        return stamp.sec * 1_000_000_000 + stamp.nanosec, (rate.x, rate.y, rate.z), (force.x, force.y, force.z)
    try:
        sec, nanosec, name = _HEAD.unpack_from(data, _BODY)
        end = _HEAD.size + name
        rate_at = _BODY + end + -end % 8 + _ORIENTATION + _COVARIANCE
        rate = _VECTOR.unpack_from(data, rate_at)
        force = _VECTOR.unpack_from(data, rate_at + _VECTOR.size + _COVARIANCE)
    except struct.error as error:
        raise ValueError(f"a serialised sensor_msgs/Imu of {len(data)} bytes is cut: {error}") from error
    return sec * 1_000_000_000 + nanosec, rate, force
