"""A sample is read from a serialised Imu, and written into one, as rclpy does it, for every length of the frame's name."""

import struct

import numpy as np
import pytest
from gravcomp_node.serialised_imu import SampleWriter, read_sample
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu


def message(rng: np.random.Generator, frame: str) -> Imu:
    filled = Imu()
    filled.header.frame_id = frame
    filled.header.stamp.sec, filled.header.stamp.nanosec = int(rng.integers(2**31)), int(rng.integers(10**9))
    for vector in (filled.angular_velocity, filled.linear_acceleration, filled.orientation):
        vector.x, vector.y, vector.z = rng.normal(size=3)
    for name in ("orientation", "angular_velocity", "linear_acceleration"):
        setattr(filled, f"{name}_covariance", rng.normal(size=9))
    return filled


@pytest.mark.parametrize("length", range(18))
def test_a_sample_is_the_one_in_the_message(length):
    filled = message(np.random.default_rng(length), "x" * length)
    stamp, rate, force = read_sample(serialize_message(filled))
    assert stamp == filled.header.stamp.sec * 10**9 + filled.header.stamp.nanosec
    w, a = filled.angular_velocity, filled.linear_acceleration
    assert (rate, force) == ((w.x, w.y, w.z), (a.x, a.y, a.z))


@pytest.mark.parametrize("length", range(18))
def test_a_written_sample_is_the_message_that_rclpy_makes(length):
    rng, made = np.random.default_rng(length), Imu()
    made.header.frame_id = "x" * length
    made.orientation_covariance[0] = -1.0
    writer = SampleWriter("x" * length)
    for _ in range(2):  # the second one takes the place of the first
        made.header.stamp.sec, made.header.stamp.nanosec = int(rng.integers(2**31)), int(rng.integers(10**9))
        rate, force = rng.normal(size=(2, 3)).tolist()
        made.angular_velocity.x, made.angular_velocity.y, made.angular_velocity.z = rate
        made.linear_acceleration.x, made.linear_acceleration.y, made.linear_acceleration.z = force
        stamp = made.header.stamp
        assert deserialize_message(writer.write(stamp.sec * 10**9 + stamp.nanosec, rate, force), Imu) == made


@pytest.fixture
def little():
    return serialize_message(message(np.random.default_rng(1), ""))


@pytest.fixture
def big(little):
    body = struct.unpack("<iI", little[4:12]), struct.unpack("<37d", little[20:])
    return b"\x00\x00\x00\x00" + struct.pack(">iI", *body[0]) + struct.pack(">I", 1) + bytes(4) + struct.pack(">37d", *body[1])


def test_another_encoding_is_left_to_rclpy(little, big):
    assert read_sample(big) == read_sample(little)


@pytest.mark.parametrize("damaged", [lambda big: big[:40], lambda big: b"\xff\xff" + big[2:], lambda big: b""])
def test_a_damaged_message_of_another_encoding_is_refused_and_does_not_end_the_node(big, damaged):
    with pytest.raises(ValueError, match="cannot be read"):
        read_sample(damaged(big))


@pytest.mark.parametrize("kept", [0, 3, 11, 40, 100, 300])
def test_a_cut_message_is_refused(kept):
    cut = (serialize_message(message(np.random.default_rng(2), "imu"))[:kept]).ljust(2, b"\x01")
    cut = b"\x00\x01" + cut[2:]
    if kept < 240:
        with pytest.raises(ValueError, match="is cut"):
            read_sample(cut)
    else:  # the last numbers, which are not read, are missing
        read_sample(cut)
