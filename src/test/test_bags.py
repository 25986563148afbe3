"""Bags can be read by rosbags and by gravcomp, complete or cut off anywhere."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from gravcomp.recordings.bags import BagError
from gravcomp.recordings.bags.definitions import Definitions
from gravcomp.recordings.bags.qos import offered_qos
from gravcomp.recordings.bags.recovery import readable
from gravcomp.recordings.bags.writing import BagWriter
from gravcomp.recordings.imu import read_recording

IMU = "sensor_msgs/msg/Imu"
SENSOR = offered_qos("RELIABLE", "VOLATILE", "KEEP_LAST", 5)


@pytest.fixture(scope="module")
def store():
    return get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture(scope="module")
def definitions(store):
    """Definitions without an installed ROS, as from a bag."""
    known = Definitions([])
    known.add_text(IMU, store.generate_msgdef(IMU, ros_version=2)[0])
    return known


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))


def imu(store, i: int) -> bytes:
    types = store.types
    vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
    return bytes(store.serialize_cdr(types[IMU](
        header=types["std_msgs/msg/Header"](stamp=time(sec=1 + i // 100, nanosec=i % 100 * 10_000_000), frame_id="imu_link"),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0), orientation_covariance=np.zeros(9),
        angular_velocity=vector(x=0.001 * i, y=0.0, z=0.0), angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(x=0.0, y=0.0, z=9.81), linear_acceleration_covariance=np.zeros(9),
    ), IMU))  # fmt: skip


def write(path: Path, store, definitions, count: int = 300, close: bool = True, chunk: int = 100) -> Path:
    bag = BagWriter(path, flush_interval=0.0, definitions=definitions)
    topic = bag.add_topic("/imu/data_raw", IMU, [SENSOR])
    for i in range(count):
        bag.write(topic, 1_000_000_000 + 10_000_000 * i, imu(store, i))
        if (i + 1) % chunk == 0:
            bag.flush()
    if close:
        bag.close()
    return path


def test_a_bag_is_mcap_of_version_9_with_the_offered_qos_and_the_hash_of_the_type(tmp_path, store, definitions):
    path = write(tmp_path / "bag", store, definitions)
    text = (path / "metadata.yaml").read_text(encoding="utf-8")
    assert "version: 9" in text and "storage_identifier: mcap" in text
    assert store.hash_rihs01(IMU) in text
    with Reader(path) as bag:
        (topic,) = bag.connections
        assert topic.ext.offered_qos_profiles == [SENSOR]
        assert bag.message_count == 300


def test_a_bag_is_not_overwritten(tmp_path, store, definitions):
    path = write(tmp_path / "bag", store, definitions, count=1)
    with pytest.raises(BagError, match="exists; a bag is not overwritten"):
        BagWriter(path)


def test_a_type_that_is_not_installed_is_named(tmp_path):
    with pytest.raises(BagError, match=r"no share/nowhere_msgs/msg/Thing\.msg"):
        Definitions([tmp_path]).of("nowhere_msgs/msg/Thing")


def test_definitions_come_from_the_installed_files(tmp_path, store):
    for name, text in (
        ("a_msgs/msg/Outer", "b_msgs/Inner[] many\nb_msgs/Inner[2] two\nfloat64 x\n"),
        ("b_msgs/msg/Inner", "int32 i\n"),
    ):
        package, _, message = name.split("/")
        folder = tmp_path / "share" / package / "msg"
        folder.mkdir(parents=True)
        (folder / f"{message}.msg").write_text(text, encoding="utf-8")
    definition, digest = Definitions([tmp_path]).of("a_msgs/msg/Outer")
    assert "MSG: b_msgs/Inner" in definition and digest.startswith("RIHS01_")


def test_a_complete_bag_is_used_as_it_is(tmp_path, store, definitions):
    path = write(tmp_path / "bag", store, definitions)
    bag = readable(path)
    assert (bag.path, bag.problem, bag.messages) == (path, "", 300)


def test_a_recorder_that_was_killed_loses_only_what_was_not_flushed(tmp_path):
    """A separate process, killed between two flushes."""
    script = textwrap.dedent(f"""
        import os, signal, sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from pathlib import Path
        from test_bags import IMU, Definitions, Stores, get_typestore, write
        store = get_typestore(Stores.ROS2_JAZZY)
        known = Definitions([])
        known.add_text(IMU, store.generate_msgdef(IMU, ros_version=2)[0])
        write(Path({str(tmp_path / "bag")!r}), store, known, count=250, close=False)
        os.kill(os.getpid(), signal.SIGKILL)
    """)
    assert subprocess.run([sys.executable, "-c", script], env=os.environ).returncode == -9
    bag = readable(tmp_path / "bag")
    assert bag.messages == 200 and bag.problem
    recording = read_recording(tmp_path / "bag")
    np.testing.assert_allclose(recording.gyro[:, 0], 0.001 * np.arange(200))


@pytest.mark.parametrize("part", [0.3, 0.5, 0.7, 0.999])
def test_a_bag_that_was_cut_off_is_read_up_to_the_last_complete_chunk(tmp_path, store, definitions, part):
    path = write(tmp_path / "bag", store, definitions, chunk=20)
    file = path / "bag.mcap"
    whole = file.read_bytes()
    file.write_bytes(whole[: int(part * len(whole))])
    bag = readable(path)
    assert bag.problem
    # The index at the end takes part of the file, so more messages than `part` are readable.
    assert 300 * part - 20 <= bag.messages <= 300 and bag.messages % 20 == 0
    assert len(read_recording(path)) == bag.messages


@pytest.mark.parametrize("part", [0.4, 0.7, 0.95])
def test_an_sqlite_bag_that_was_cut_off_is_read_up_to_the_first_missing_page(tmp_path, store, part):
    path = tmp_path / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        topic = bag.add_connection("/imu/data_raw", IMU, typestore=store)
        for k in range(400):
            bag.write(topic, 10**9 + k * 10**7, imu(store, k))
    file = path / "bag.db3"
    whole = file.read_bytes()
    file.write_bytes(whole[: int(part * len(whole))])
    bag = readable(path)
    assert bag.problem
    # The pages of other tables and of an index take part of the file.
    assert 400 * part - 80 <= bag.messages <= 400
    np.testing.assert_allclose(read_recording(path).gyro[:, 0], 0.001 * np.arange(bag.messages))


def test_a_bag_with_damage_in_the_middle_is_read_up_to_it(tmp_path, store, definitions):
    path = write(tmp_path / "bag", store, definitions, chunk=20)
    file = path / "bag.mcap"
    whole = bytearray(file.read_bytes())
    middle = len(whole) // 2
    whole[middle : middle + 2000] = os.urandom(2000)
    file.write_bytes(whole)
    assert 0 < readable(path).messages < 300


def test_the_recording_itself_is_not_changed(tmp_path, store, definitions):
    path = write(tmp_path / "bag", store, definitions)
    (path / "metadata.yaml").unlink()
    before = sorted((p.name, p.stat().st_mtime_ns) for p in path.iterdir())
    assert readable(path).messages == 300
    assert sorted((p.name, p.stat().st_mtime_ns) for p in path.iterdir()) == before


def test_a_damaged_bag_is_read_under_two_names(tmp_path, store, definitions):
    path = write(tmp_path / "bag", store, definitions)
    (path / "metadata.yaml").unlink()
    first = readable(path)
    path.rename(tmp_path / "other")
    assert readable(tmp_path / "other").messages == first.messages == 300


@pytest.mark.parametrize(
    ("content", "sentence"),
    [(b"", r"is empty: bag\.mcap has 0 bytes"), (b"not a bag at all" * 100, "nothing in it can be read")],
)
def test_a_file_that_is_no_bag_is_refused_with_the_reason(tmp_path, content, sentence):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag.mcap").write_bytes(content)
    with pytest.raises(BagError, match=sentence):
        readable(tmp_path / "bag")


def test_missing_and_empty_folders_have_different_errors(tmp_path):
    with pytest.raises(BagError, match="does not exist"):
        readable(tmp_path / "nowhere")
    with pytest.raises(BagError, match=r"no \.mcap and no \.db3 file"):
        readable(tmp_path)
