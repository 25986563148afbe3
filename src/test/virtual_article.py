"""Robots for the tests of the virtual robot."""

import dataclasses

import numpy as np

from gravcomp.description import Robot
from gravcomp.description.hardware import Hardware, parse_hardware
from gravcomp.description.robot_file import load_robot_file
from gravcomp.virtual.parameters import Body, VirtualRobotParameters
from gravcomp.virtual.robot import VirtualRobot

GRAVITY = 9.81


def article() -> tuple[Robot, Hardware]:
    file = load_robot_file("article")
    return file.robot, parse_hardware(file.section("hardware"), source=file.source)


def reference_robot() -> Robot:
    """The hollow cylinder of the CalculiX table, with the article's cables."""
    robot, _ = article()
    return dataclasses.replace(robot, segments=tuple(dataclasses.replace(s, lumen_diameter=3e-3) for s in robot.segments))


def with_body(**changes) -> VirtualRobotParameters:
    return VirtualRobotParameters(body=dataclasses.replace(Body(), **changes))


def horizontal() -> np.ndarray:
    """Gravity in soft_base of a horizontal robot."""
    return np.array([-GRAVITY, 0.0, 0.0])


def virtual_robot(parameters: VirtualRobotParameters | None = None, **options) -> VirtualRobot:
    robot, hardware = article()
    return VirtualRobot(parameters or VirtualRobotParameters(), robot, hardware, **options)
