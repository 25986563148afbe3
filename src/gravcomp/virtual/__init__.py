"""The virtual robot: rod, tendons, motors, board and base motion behind CAN frames, so that software can be judged without
hardware.

It shares no model with the controller. `VirtualRobot(parameters, robot, hardware, seed).step(dt, frames) -> frames`.
"""

from gravcomp.cache import configure_numba

configure_numba()  # before the first module here imports Numba
