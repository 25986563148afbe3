"""The sense of gravity: nodes imu_estimator and imu_replay."""
