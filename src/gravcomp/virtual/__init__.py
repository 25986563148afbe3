"""The virtual robot: rod, tendons, motors, board and base motion behind CAN frames, for tests without hardware.

It shares no mechanical model with the controller. `VirtualRobot(parameters, robot, hardware, seed).step(dt, frames) -> frames`.
"""
