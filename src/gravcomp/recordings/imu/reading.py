"""Choice of the reader by the kind of the path."""

from collections.abc import Callable
from pathlib import Path

from gravcomp.recordings.bags.storage import is_storage
from gravcomp.recordings.imu.broad import read_broad
from gravcomp.recordings.imu.csv_columns import CsvColumns
from gravcomp.recordings.imu.csv_files import is_csv, read_csv
from gravcomp.recordings.imu.recording import Recording, RecordingError
from gravcomp.recordings.imu.rosbag import read_rosbag

_KINDS = "an .npz file in BROAD's layout, a CSV file or folder, or a rosbag2 folder"


def read_recording(
    path: str | Path,
    topic: str | None = None,
    columns: CsvColumns | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Read an .npz file in BROAD's layout, CSV, or a rosbag2 folder.

    topic: the IMU topic of a bag with several; columns: of a CSV file whose names do not say what they are; progress: receives
    the share of a bag that is read. Raises RecordingError, which names what was found and what is needed.
    """
    path = Path(path).expanduser()
    if not path.exists():
        raise RecordingError(f"{path}: does not exist; {_KINDS} is needed")
    is_bag = is_storage(path) or (path.is_dir() and not is_csv(path))
    if topic is not None and not is_bag:
        raise RecordingError(f"{path}: is no bag, so that it has no topic '{topic}' to choose")
    if is_csv(path):
        return read_csv(path, columns)
    if is_bag:
        return read_rosbag(path, topic, progress)
    if path.suffix == ".bag":
        way = f"rosbags-convert --src {path} --dst {path.with_suffix('')}"
        raise RecordingError(f"{path}: is a bag of ROS 1; a rosbag2 folder is needed: {way}")
    if path.suffix != ".npz":
        raise RecordingError(f"{path}: is of no known kind; {_KINDS} is needed")
    return read_broad(path)
