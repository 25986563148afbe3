"""IMU recordings: samples and ground truth as arrays, from the files in which users have them.

recording = read_recording("trial.npz")        # a rosbag2 folder, or CSV
recording.gyro, recording.accel                # (n, 3) rad/s, m/s^2
"""

from gravcomp.recordings.imu.csv_columns import CsvColumns
from gravcomp.recordings.imu.csv_files import is_csv, read_mapping
from gravcomp.recordings.imu.reading import read_recording
from gravcomp.recordings.imu.recording import Recording, RecordingError

__all__ = ["CsvColumns", "Recording", "RecordingError", "is_csv", "read_mapping", "read_recording"]
