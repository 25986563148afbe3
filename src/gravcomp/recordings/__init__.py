"""Recordings: `imu` reads IMU streams, `bags` reads and writes rosbag2 folders."""
