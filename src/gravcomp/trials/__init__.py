"""Measurements on the virtual robot: compensation at a pose, free fall, calibration run, reaching through a lumen, yaw drift."""
