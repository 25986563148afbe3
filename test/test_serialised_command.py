"""A cable command is read and written in its serialised form as rclpy does it, for every length of its parts."""

import struct

import numpy as np
import pytest
from gravcomp_node.serialised_command import PublishedCommand, read_command
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header

from gravcomp_msgs.msg import CableCommand


def command(length: int, cables: int, tensions: int) -> PublishedCommand:
    rng = np.random.default_rng(length)
    header = Header(frame_id="x" * length)
    header.stamp.sec, header.stamp.nanosec = int(rng.integers(2**31)), int(rng.integers(10**9))
    return PublishedCommand(header, rng.normal(size=cables), rng.uniform(size=tensions))


@pytest.mark.parametrize("length", range(9))
@pytest.mark.parametrize(("cables", "tensions"), [(6, 6), (3, 0), (0, 0), (1, 1), (0, 2)])
def test_it_is_the_message_of_rclpy_both_ways(length, cables, tensions):
    made = command(length, cables, tensions)
    message, stamp = made.message(), made.header.stamp
    assert deserialize_message(made.serialised(), CableCommand) == message
    read = stamp.sec * 10**9 + stamp.nanosec, tuple(made.displacement), tuple(made.tension)
    assert read_command(serialize_message(message)) == read == read_command(made.serialised())


@pytest.mark.parametrize("kept", [0, 2, 5, 11, 20, 27, 31, 70, 79, 82, 100, 120])
def test_a_cut_one_is_refused(kept):
    with pytest.raises(ValueError, match="bytes"):
        read_command(command(9, 6, 6).serialised()[:kept])


def test_a_length_beyond_the_message_is_refused_without_memory_for_it():
    damaged = bytearray(command(3, 6, 6).serialised())
    struct.pack_into("<I", damaged, 20, 2**32 - 1)
    with pytest.raises(ValueError, match="is cut"):
        read_command(bytes(damaged))


def test_another_encoding_is_left_to_rclpy():
    big = b"\x00\x00\x00\x00" + struct.pack(">iII", 5, 7, 4) + b"imu\0" + struct.pack(">I4xd", 1, 0.25) + struct.pack(">I", 0)
    assert read_command(big) == (5_000_000_007, (0.25,), ())
