"""Choice of the reader by the kind of the path."""

from pathlib import Path

from gravcomp.recordings.imu.broad import read_broad
from gravcomp.recordings.imu.recording import Recording, RecordingError
from gravcomp.recordings.imu.rosbag import read_rosbag


def read_recording(path: str | Path, topic: str | None = None) -> Recording:
    """Read an .npz file in BROAD's layout or a rosbag2 folder; `topic` names the IMU topic of a bag with several.

    Raises RecordingError, which names what was found and what is needed.
    """
    path = Path(path).expanduser()
    if not path.exists():
        raise RecordingError(f"{path}: does not exist; an .npz file in BROAD's layout or a rosbag2 folder is needed")
    if path.is_dir() or path.suffix in (".mcap", ".db3"):
        return read_rosbag(path, topic)
    if path.suffix != ".npz":
        raise RecordingError(f"{path}: is neither an .npz file in BROAD's layout nor a rosbag2 folder")
    return read_broad(path)
