"""Bags of earlier ROS 2 releases are read as those of today: complete, without metadata.yaml, cut off, with foreign types."""

import dataclasses
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from older_bags import RELEASES, Topic, write_mcap, write_sqlite
from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
from rosbags.typesys import Stores, get_typestore
from test_bags import IMU, imu

from gravcomp.commands.__main__ import main
from gravcomp.recordings.bags import decoding
from gravcomp.recordings.bags.recovery import readable
from gravcomp.recordings.bags.streams import VECTOR, Wanted, read_streams
from gravcomp.recordings.imu import RecordingError, read_recording

COUNT = 150
WRITERS = {"sqlite": write_sqlite, "mcap": write_mcap}
FOREIGN = Topic("/scan", "some_lidar_msgs/msg/Scan", [(10**9, b"\x00\x01\x00\x00" + bytes(8))], "float64 range\n")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def topics():
    """The IMU, and a vector of the virtual robot."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    made = store.types
    header = made["std_msgs/msg/Header"](stamp=made["builtin_interfaces/msg/Time"](sec=1, nanosec=0), frame_id="base")
    vector = made[VECTOR](header=header, vector=made["geometry_msgs/msg/Vector3"](x=1.0, y=2.0, z=3.0))
    contents = {
        IMU: [(10**9 + 10**7 * i, imu(store, i)) for i in range(COUNT)],
        VECTOR: [(10**9 + 10**7 * i, bytes(store.serialize_cdr(vector, VECTOR))) for i in range(3)],
    }
    names = {IMU: "/camera/imu", VECTOR: "/truth/tip"}
    return [
        Topic(names[kind], kind, messages, store.generate_msgdef(kind, ros_version=2)[0], store.hash_rihs01(kind))
        for kind, messages in contents.items()
    ]


def check(path, problem=""):
    recording = read_recording(path)
    np.testing.assert_allclose(recording.gyro[:, 0], 0.001 * np.arange(COUNT))
    assert problem in "".join(recording.notes) and bool(problem) == bool(recording.notes)


@pytest.mark.parametrize(("release", "storage"), [*((each, "sqlite") for each in RELEASES), ("humble", "mcap"), ("iron", "mcap")])
def test_a_bag_of_an_earlier_release_is_read(tmp_path, topics, release, storage):
    path = WRITERS[storage](tmp_path / "bag", RELEASES[release], topics)
    assert not readable(path).problem  # as it is, without a copy
    check(path)
    stream = read_streams(path, {"tip": Wanted(VECTOR, ("truth/tip",))})["tip"]
    np.testing.assert_array_equal(stream.values, [[1.0, 2.0, 3.0]] * 3)


@pytest.mark.parametrize(("release", "storage"), [("humble", "sqlite"), ("iron", "sqlite"), ("humble", "mcap")])
def test_topics_of_types_that_nobody_here_knows_are_passed_over(tmp_path, topics, release, storage):
    path = WRITERS[storage](tmp_path / "bag", RELEASES[release], [*topics, FOREIGN])
    check(path)
    (path / "metadata.yaml").unlink()
    known = storage == "mcap" or release == "iron"  # the file has the definitions
    problem = "metadata.yaml is missing" + ("" if known else "; without /scan, of types that are not installed")
    for _ in range(2):  # recovered, and from the copy
        check(path, problem)


@pytest.mark.parametrize(("release", "storage"), [("humble", "sqlite"), ("iron", "mcap")])
def test_a_bag_that_was_cut_off_is_read_up_to_there(tmp_path, topics, release, storage):
    path = WRITERS[storage](tmp_path / "bag", RELEASES[release], [topics[0], FOREIGN])
    (file,) = path.glob("bag_0.*")
    file.write_bytes(file.read_bytes()[: int(0.7 * file.stat().st_size)])
    recording = read_recording(path)
    assert 0.5 * COUNT < len(recording) < COUNT and "damaged" in recording.notes[0]


def test_a_definition_that_cannot_be_read_matters_only_to_its_own_topic(tmp_path, topics):
    damaged = Topic(FOREIGN.name, FOREIGN.kind, FOREIGN.messages, "float64 [[\n")
    check(write_mcap(tmp_path / "bag", RELEASES["iron"], [*topics, damaged]))
    wrong = dataclasses.replace(topics[0], definition=topics[0].definition.replace("float64 x", "float32 x"))
    with pytest.raises(RecordingError, match="the definition of sensor_msgs/msg/Imu has the hash"):
        read_recording(write_mcap(tmp_path / "wrong", RELEASES["iron"], [wrong]))


def test_definitions_are_read_once_for_all_bags(tmp_path, topics, monkeypatch):
    path = write_mcap(tmp_path / "bag", RELEASES["iron"], topics)
    check(path)
    read = []
    monkeypatch.setattr(decoding, "get_types_from_msg", lambda *definition: read.append(definition))
    check(path)
    check(write_sqlite(tmp_path / "other", RELEASES["iron"], topics))
    assert not read


@pytest.mark.parametrize("named", [False, True])
def test_messages_with_definitions_in_idl_are_decoded(named):
    line = 80 * "=" + "\nIDL: "
    point = "module a_msgs {\nmodule msg {\nstruct Point {\ndouble x;\n};\n};\n};\n"
    pair = "module a_msgs {\nmodule msg {\nstruct Pair {\na_msgs::msg::Point one;\ndouble other;\n};\n};\n};\n"
    text = f"{line}a_msgs/msg/Pair\n{pair}{line}a_msgs/msg/Point\n{point}" if named else point
    kind = "a_msgs/msg/Pair" if named else "a_msgs/msg/Point"
    connection = SimpleNamespace(msgtype=kind, msgdef=MessageDefinition(MessageDefinitionFormat.IDL, text), digest="")
    message = decoding.decoded(connection, b"\x00\x01\x00\x00" + struct.pack("<2d", 1.5, 2.5)[: 16 if named else 8])
    assert (message.one.x, message.other) == (1.5, 2.5) if named else message.x == 1.5


def test_the_commands_read_a_bag_of_an_earlier_release(tmp_path, topics, capsys):
    path = write_sqlite(tmp_path / "bag", RELEASES["humble"], [*topics, FOREIGN])
    assert main(["estimate", str(path), "--json", "--imu-topic", "/camera/imu"]) == 0
    assert "renamed" not in capsys.readouterr().err
    assert main(["calibrate-imu", str(path)]) == 2
    assert "never rests" in capsys.readouterr().err  # read, but not fit for it
    assert main(["estimate", str(path), "--topic", "/imu/data_raw"]) == 2
    said = capsys.readouterr().err
    assert "--topic has been renamed; write --imu-topic: the earlier name is taken until release 0.3" in said
    assert "no sensor_msgs/msg/Imu on '/imu/data_raw'; found: /camera/imu" in said
