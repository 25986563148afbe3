"""Recordings of an IMU: .npz files in BROAD's layout and rosbag2 folders, as arrays with stamps.

recording = read_recording("trial.npz")        # or a rosbag2 folder
recording.stamp_ns, recording.gyro, recording.accel, recording.orientation
"""

from gravcomp.recordings.imu.reading import read_recording
from gravcomp.recordings.imu.recording import Recording, RecordingError

__all__ = ["Recording", "RecordingError", "read_recording"]
