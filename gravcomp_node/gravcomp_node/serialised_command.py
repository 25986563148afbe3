"""A gravcomp_msgs/CableCommand read from its serialised form, and written into it.

The command is the last message between sample and motor. In a process with cold caches rclpy takes about as long to make one, to
convert it and to make it again from what arrives as the middleware does to carry it.
"""

import struct
from dataclasses import dataclass

import numpy as np
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

from gravcomp_msgs.msg import CableCommand
from gravcomp_node import cdr
from gravcomp_node.array_fields import doubles

_COUNT = struct.Struct("<I")


@dataclass(frozen=True)
class PublishedCommand:
    """Displacements (m,) in m and tensions (m,) in N, with the header of their message."""

    header: Header
    displacement: np.ndarray
    tension: np.ndarray

    def message(self) -> CableCommand:
        """Return the message."""
        return CableCommand(header=self.header, displacement=doubles(self.displacement), tension=doubles(self.tension))

    def serialised(self) -> bytes:
        """Return the message, serialised."""
        stamp = self.header.stamp
        data = cdr.written_head(stamp.sec, stamp.nanosec, self.header.frame_id)
        for values in (self.displacement, self.tension):
            cdr.pad(data, _COUNT.size)
            data += _COUNT.pack(len(values))
            if len(values):
                cdr.pad(data, 8)
            data += np.asarray(values, "<f8").tobytes()
        return bytes(data)


def read_command(data: bytes) -> tuple[int, tuple[float, ...], tuple[float, ...]]:
    """Return stamp in ns, displacements in m, tensions in N. Raises ValueError for a damaged message."""
    if data[:2] != cdr.LITTLE_ENDIAN:
        try:
            message = deserialize_message(data, CableCommand)
        except RuntimeError as error:
            raise ValueError(f"a serialised gravcomp_msgs/CableCommand of {len(data)} bytes cannot be read: {error}") from error
        stamp = message.header.stamp
        return stamp.sec * 1_000_000_000 + stamp.nanosec, tuple(message.displacement), tuple(message.tension)
    try:
        sec, nanosec, name = cdr.HEAD.unpack_from(data, cdr.BODY)
        displacement, end = _read_doubles(data, cdr.HEAD.size + name)
        tension, _ = _read_doubles(data, end)
    except struct.error as error:
        raise ValueError(f"a serialised gravcomp_msgs/CableCommand of {len(data)} bytes is cut: {error}") from error
    return sec * 1_000_000_000 + nanosec, displacement, tension


def _read_doubles(data: bytes, at: int) -> tuple[tuple[float, ...], int]:
    """Return the float64[] whose length comes next after `at` bytes of the body, and where it ends."""
    at += -at % _COUNT.size
    (count,) = _COUNT.unpack_from(data, cdr.BODY + at)
    at += _COUNT.size
    at += -at % 8 if count else 0
    return struct.unpack_from(f"<{count}d", data, cdr.BODY + at), at + 8 * count
