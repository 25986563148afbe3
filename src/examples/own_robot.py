"""Read your own robot from its file, vary it in Python, and compute its mass, its sag and the tensions that compensate it."""

import dataclasses
from pathlib import Path

import numpy as np

from gravcomp.description import load_robot_file
from gravcomp.inverse import InverseController, straight_target
from gravcomp.simulation import RobotModel, Simulator

HORIZONTAL = np.array([-9.81, 0.0, 0.0])  # m/s^2 in soft_base


def compensated(simulator: Simulator):
    """Return the shape after the loop of model and inverse problem has settled."""
    robot, shape = simulator.robot, simulator.solve(HORIZONTAL)
    controller, target = InverseController(robot), straight_target(robot.length)
    for _ in range(80):
        command = controller.step(
            shape.response, target, backbone_station=shape.backbone_station, tension=shape.cable_tension, interval=0.02
        )
        shape = simulator.step(HORIZONTAL, command.displacement)
    return shape


file = load_robot_file(Path(__file__).with_name("own_robot.yaml"))
segment = file.robot.segments[0]
variants = {
    "as in the file": file.robot,
    "twice as stiff": file.robot.with_material(youngs_modulus=2 * segment.material.youngs_modulus),
    "10 mm thick": dataclasses.replace(
        file.robot,
        segments=(dataclasses.replace(segment, outer_diameter=0.010),),
    ),
}

for name, robot in variants.items():
    simulator = Simulator(RobotModel(robot), reduced=False)
    sag = simulator.solve(HORIZONTAL).tip_position[0]
    shape = compensated(simulator)
    area = np.pi / 4 * (robot.segments[0].outer_diameter ** 2 - segment.lumen_diameter**2)
    print(
        f"{name:15s} {1e3 * segment.material.density * area * robot.length:5.1f} g, sags {-1e3 * sag:5.1f} mm,"
        f" compensated to {-1e3 * shape.tip_position[0]:6.3f} mm with at most {shape.cable_tension.max():.2f} N"
        f" and {1e3 * np.abs(shape.cable_displacement).max():.2f} mm of cable"
    )
