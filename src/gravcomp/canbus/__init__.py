"""CAN: the frames (gravcomp.dbc, FRAMES.md), their codec, IMU samples from frames, and buses that are reopened after an error."""
