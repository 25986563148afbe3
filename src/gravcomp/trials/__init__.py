"""Single runs on the virtual robot that measure something: a pose held, a free fall, a calibration run, a lumen reached through, a drift of yaw."""
