"""The shape in which a planned pose holds the robot as it is at rest: the controller's own inverse problem finds the tensions.

A fit to tips of single cables alone puts into lines and zeros what the model lacks at large bends, where it is not used
afterwards. Poses in which all cables work together as they will in use keep it right there.
"""

import numpy as np

from gravcomp.description import Robot
from gravcomp.description.transmission import Transmission
from gravcomp.inverse import ControllerCode, InverseOptions, direction_weight, rest_target
from gravcomp.inverse.controller import InverseController
from gravcomp.simulation import Shape, Simulator

_STEPS = 60  # most of the iteration
_INTERVAL = 0.1  # s of a step: the longest in which the controller moves
_SETTLED = 1e-5  # of the robot's length: cables that move less have arrived


def held_at_rest(
    simulator: Simulator, robot: Robot, transmission: Transmission | None, options: InverseOptions, gravity: np.ndarray
) -> Shape | None:
    """Return the shape nearest to that at rest under gravity (3,) in m/s^2; None: the cables cannot bring the robot there.

    The solver of the simulator is left at that shape.
    """
    controller = InverseController(robot, options, transmission)
    target = rest_target(robot, tip_direction_weight=direction_weight(robot.length))
    shape, last = simulator.solve(gravity), np.full(len(robot.cables), np.inf)
    for _ in range(_STEPS):
        command = controller.step(
            shape.response,
            target,
            backbone_station=shape.backbone_station,
            tension=shape.cable_tension,
            interval=_INTERVAL,
            followed=shape.is_equilibrium,
            gravity=gravity,
        )
        shape = simulator.step(gravity, command.displacement)
        if command.code == ControllerCode.RELAXING or not shape.is_equilibrium:
            return None
        if np.abs(command.displacement - last).max(initial=0.0) < _SETTLED * robot.length:
            break
        last = command.displacement
    return shape
