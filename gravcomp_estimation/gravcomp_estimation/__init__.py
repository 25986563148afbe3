"""Estimation side of gravcomp: the nodes imu_estimator, imu_replay and arm_gravity."""
