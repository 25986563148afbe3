"""The check that the cables of an antagonistic pair pull on opposite sides of the robot."""

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description.cable import Cable
from gravcomp.description.hardware import Hardware
from gravcomp.description.robot import Robot


def check_pairs(hardware: Hardware, robot: Robot, source: str) -> None:
    """Raise ConfigError for an antagonistic pair whose cables run on the same side of the robot."""
    places = {cable.name: cable for cable in robot.cables}
    for index, motor in enumerate(hardware.motors):
        if motor.pair is None:
            continue
        one, other = (_side(places[name]) for name in (motor.cable, motor.pair))
        if one @ other > 0.0:
            raise ConfigError(
                f"{source}: hardware.motors[{index}].pair is '{motor.pair}', on the same side of the robot as '{motor.cable}';"
                " allowed: a cable on the other side (cables that run together are written in `also`, with their ratio)"
            )


def _side(cable: Cable) -> np.ndarray:
    """Return where the cable enters the body, (x, y) in m."""
    if cable.via_points is not None:
        return np.array(cable.via_points[0][:2])
    return np.array(cable.place(cable.start, cable.start + 1.0))
