"""The beginning of a serialised message that has a header, for modules that read and write single messages without rclpy.

The layout is that of CDR (OMG DDS-XTypes 1.3, 7.4.1): each number at a multiple of its size, counted after the four bytes that
name the encoding. All middlewares on usual computers use the little-endian one.
"""

import struct

LITTLE_ENDIAN = b"\x00\x01"
BODY = 4
"""Bytes before the body, of which LITTLE_ENDIAN are the first two."""
HEAD = struct.Struct("<iII")
"""s, ns, length of the frame's name with its final zero."""


def written_head(sec: int, nanosec: int, frame: str) -> bytearray:
    """Return the encoding and a std_msgs/Header, up to the end of the frame's name."""
    name = frame.encode() + b"\0"
    return bytearray(LITTLE_ENDIAN + bytes(2) + HEAD.pack(sec, nanosec, len(name)) + name)


def pad(data: bytearray, size: int) -> None:
    """Fill up to where a number of `size` bytes may begin."""
    data += bytes(-(len(data) - BODY) % size)
