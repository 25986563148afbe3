"""Recordings in BROAD's layout and in rosbag2 folders; others are refused with what was found and what is needed."""

import tracemalloc

import numpy as np
import pytest

from gravcomp.recordings.imu import Recording, RecordingError, read_recording
from gravcomp.recordings.imu.broad_folder import around_first_motion


def write_npz(path, **changes):
    arrays = {
        "gyr": np.zeros((10, 3), np.float32),
        "acc": np.tile(np.array([0, 0, 9.81], np.float32), (10, 1)),
        "rate": 100.0,
        "quat": np.tile(np.array([1.0, 0, 0, 0]), (10, 1)),
        "movement": np.ones(10, bool),
    } | changes
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    return path


def test_broads_layout_is_read_with_truth_and_stamps(tmp_path):
    recording = read_recording(write_npz(tmp_path / "a.npz"))
    assert recording.stamp_ns.tolist()[:3] == [0, 10_000_000, 20_000_000]
    assert recording.rate == pytest.approx(100.0)
    assert recording.orientation.shape == (10, 4) and recording.movement.all()


def test_truth_is_optional(tmp_path):
    recording = read_recording(write_npz(tmp_path / "a.npz", quat=None, movement=None))
    assert recording.orientation is None and recording.movement is None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"gyr": None}, "lacks gyr"),
        ({"gyr": np.zeros((10, 4))}, r"gyr has the shape \(10, 4\); \(N, 3\)"),
        ({"acc": np.zeros(10)}, r"acc has the shape \(10,\)"),
        ({"acc": np.zeros((9, 3))}, "gyr has 10 samples, acc has 9"),
        ({"acc": np.full((10, 3), np.nan)}, "accel has no finite sample among its 10"),
        ({"gyr": np.full((10, 3), "x")}, "gyr is of type"),
        ({"quat": np.zeros((8, 4))}, r"orientation has the shape \(8, 4\)"),
        ({"rate": 0.0}, "rate is 0"),
        ({"rate": np.array([1.0, 2.0])}, "one number of 0.1 to 100000 Hz"),
        ({"movement": np.full(10, 7)}, "booleans are needed"),
        ({"gyr": np.zeros((1, 3)), "acc": np.zeros((1, 3)), "quat": None, "movement": None}, "at least 2"),
    ],
)
def test_an_unusable_npz_is_refused_with_what_was_found(tmp_path, changes, words):
    path = write_npz(tmp_path / "bad.npz", **changes)
    with pytest.raises(RecordingError, match=words) as refusal:
        read_recording(path)
    assert "bad.npz" in str(refusal.value)


def test_files_of_other_kinds_are_refused(tmp_path):
    (tmp_path / "text.npz").write_text("hello", encoding="utf-8")
    (tmp_path / "folder").mkdir()
    (tmp_path / "a.csv").write_text("1,2", encoding="utf-8")
    (tmp_path / "a.jpg").write_text("", encoding="utf-8")
    (tmp_path / "old.bag").write_text("#ROSBAG V2.0", encoding="utf-8")
    for name, words in (
        ("text.npz", "is not an .npz"),
        ("folder", "is not a bag"),
        ("a.csv", "lacks a rate and a specific force"),
        ("a.jpg", "of no known kind"),
        ("old.bag", "is a bag of ROS 1; .* rosbags-convert --src"),
        ("none", "does not exist"),
    ):
        with pytest.raises(RecordingError, match=words):
            read_recording(tmp_path / name)


def test_averaging_keeps_the_truth_at_the_end_of_each_window():
    stamp = np.arange(7) * 1000
    truth = np.arange(28.0).reshape(7, 4)
    recording = Recording("x", stamp, np.arange(21.0).reshape(7, 3), np.ones((7, 3)), orientation=truth).averaged(3)
    assert recording.stamp_ns.tolist() == [2000, 5000]
    assert recording.gyro[0].tolist() == [3.0, 4.0, 5.0]
    assert recording.orientation.tolist() == [truth[2].tolist(), truth[5].tolist()]


def test_a_part_of_a_recording_has_the_seconds_from_its_beginning_to_its_end():
    stamp = 5 * 10**9 + np.arange(7) * 10**9
    truth = np.arange(28.0).reshape(7, 4)
    recording = Recording("x", stamp, np.arange(21.0).reshape(7, 3), np.ones((7, 3)), orientation=truth).between(1.0, 3.0)
    assert recording.stamp_ns.tolist() == stamp[1:4].tolist()
    assert recording.gyro[-1].tolist() == [9.0, 10.0, 11.0] and recording.accel.shape == (3, 3)
    assert recording.orientation.tolist() == truth[1:4].tolist() and recording.movement is None


def test_a_part_of_a_trial_has_rest_and_motion():
    stamp = 5 * 10**9 + np.arange(100) * 10**9
    trial = Recording("x", stamp, np.ones((100, 3)), np.ones((100, 3)), movement=np.arange(100) >= 40)
    part = around_first_motion(trial)
    assert np.count_nonzero(~part.movement) >= 15 and np.count_nonzero(part.movement) > 15 and len(part) < 40
    unknown = around_first_motion(Recording("x", stamp, np.ones((100, 3)), np.ones((100, 3))))
    assert len(unknown) == len(part) and unknown.stamp_ns[0] == stamp[0]
    assert part.stamp_ns.tolist() == stamp[(stamp >= part.stamp_ns[0]) & (stamp <= part.stamp_ns[-1])].tolist()


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_rosbag_gives_samples_temperature_and_truth_by_their_stamps(tmp_path, storage):
    recording = read_recording(write_bag(tmp_path / "bag", storage))
    assert recording.stamp_ns.tolist() == [10**18 + k * 10_000_000 for k in range(5)]
    assert recording.gyro[3].tolist() == [3.0, 0.0, 0.0]
    assert recording.accel[3].tolist() == [0.0, 0.0, 9.81]
    assert recording.temperature.tolist() == [30.0]
    # Every second sample has a truth; that of the others is more than half a period away.
    assert np.isfinite(recording.orientation[:, 0]).tolist() == [True, False, True, False, True]


@pytest.mark.parametrize("metadata", [True, False])
@pytest.mark.parametrize("compressed", ["FILE", "MESSAGE"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_compressed_by_zstd_is_read_with_and_without_its_metadata(tmp_path, monkeypatch, storage, compressed, metadata):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    bag = write_bag(tmp_path / "bag", storage, compressed=compressed)
    if not metadata:
        (bag / "metadata.yaml").unlink()
    recording = read_recording(bag)
    assert recording.gyro[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert ["metadata.yaml" in note for note in recording.notes] == ([] if metadata else [True])


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_split_over_files_is_one_recording_without_its_metadata(tmp_path, monkeypatch, storage):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    (tmp_path / "split").mkdir()
    for part, first in enumerate((0, 5)):
        (file,) = (f for f in write_bag(tmp_path / f"part{part}", storage, first=first).iterdir() if f.suffix != ".yaml")
        file.rename(tmp_path / "split" / f"split_{part}{file.suffix}")
    assert read_recording(tmp_path / "split").gyro[:, 0].tolist() == [float(k) for k in range(10)]


def test_a_bag_with_several_imus_needs_the_name_of_a_topic(tmp_path):
    bag = write_bag(tmp_path / "bag", "mcap", topics=("/a/imu/data", "/b/imu/data"))
    with pytest.raises(RecordingError, match="/a/imu/data, /b/imu/data; name one"):
        read_recording(bag)
    assert len(read_recording(bag, "/b/imu/data")) == 5


def test_a_bag_without_imu_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="no topic of type sensor_msgs/msg/Imu"):
        read_recording(write_bag(tmp_path / "bag", "mcap", topics=()))


def test_a_bag_whose_imu_has_no_message_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="has 0 IMU samples"):
        read_recording(write_bag(tmp_path / "bag", "mcap", samples=0))


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_memory_to_read_a_bag_does_not_grow_with_its_other_topics(tmp_path, storage):
    size, shares = 400_000, []
    bag = write_bag(tmp_path / "bag", storage, samples=2000, images=(75, size))
    read_recording(bag)  # imports
    tracemalloc.start()
    recording = read_recording(bag, progress=shares.append)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(recording) == 2000 and peak < 15 * size  # of 75; a chunk of MCAP has 1 MB
    assert shares == sorted(shares) and len(shares) > 3 and max(shares) <= 1.0


def write_bag(path, storage, topics=("/robot/imu/data_raw",), *, samples=5, images=(0, 0), compressed="NONE", first=0):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    time_, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    nine = np.zeros(9)

    bag = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3)
    bag.set_compression(CompressionMode[compressed], CompressionFormat.ZSTD)
    with bag as writer:

        def write(connection, kind, k, **fields):
            stamp = 10**18 + k * 10_000_000
            head = header(stamp=time_(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="imu_link")
            # The time of reception differs from the stamp and must have no effect.
            writer.write(connection, stamp + 3_000_000, store.serialize_cdr(types[kind](header=head, **fields), kind))

        temperature = writer.add_connection("/robot/imu/temperature", "sensor_msgs/msg/Temperature", typestore=store)
        truth = writer.add_connection("/robot/virtual/base_orientation", "geometry_msgs/msg/QuaternionStamped", typestore=store)
        camera = writer.add_connection("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", typestore=store)
        write(temperature, "sensor_msgs/msg/Temperature", 2, temperature=30.0, variance=0.0)
        for topic in topics:
            imu = writer.add_connection(topic, "sensor_msgs/msg/Imu", typestore=store)
            for k in range(first, first + samples):
                if images[0] and k % max(1, samples // images[0]) == 0:  # never read, so that any bytes will do
                    writer.write(camera, 10**18 + k * 10_000_000, bytes(images[1]))
                write(
                    imu,
                    "sensor_msgs/msg/Imu",
                    k,
                    orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
                    orientation_covariance=nine,
                    angular_velocity=vector(x=float(k), y=0.0, z=0.0),
                    angular_velocity_covariance=nine,
                    linear_acceleration=vector(x=0.0, y=0.0, z=9.81),
                    linear_acceleration_covariance=nine,
                )
        for k in (0, 2, 4):
            write(truth, "geometry_msgs/msg/QuaternionStamped", k, quaternion=quaternion(x=0.0, y=0.0, z=0.0, w=1.0))
    return path
