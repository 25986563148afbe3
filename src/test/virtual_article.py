"""Robots for the tests of the virtual robot."""

import dataclasses
import functools

import numpy as np

from gravcomp.config import from_mapping
from gravcomp.description import Robot
from gravcomp.description.hardware import Hardware
from gravcomp.description.robot_file import load_robot_file
from gravcomp.virtual.draw import draw
from gravcomp.virtual.parameters import Tendons, VirtualRobotParameters
from gravcomp.virtual.robot import VirtualRobot
from gravcomp.virtual.true_robot import TrueRobot

GRAVITY = 9.81


@functools.cache
def article() -> tuple[Robot, Hardware]:
    file = load_robot_file("article")
    return file.robot, file.hardware


def reference_robot() -> Robot:
    """The hollow cylinder of the CalculiX table, with the article's cables."""
    robot, _ = article()
    return dataclasses.replace(robot, segments=tuple(dataclasses.replace(s, lumen_diameter=3e-3) for s in robot.segments))


@functools.cache
def given() -> VirtualRobotParameters:
    """What the article's robot file gives: nothing is drawn but the noise."""
    file = load_robot_file("article")
    return from_mapping(VirtualRobotParameters, file.section("virtual_robot"), source=file.source, key="virtual_robot")


def with_body(tendons: Tendons | None = None, **changes) -> VirtualRobotParameters:
    parameters = given()
    body = dataclasses.replace(parameters.body, **changes)
    return dataclasses.replace(parameters, body=body, tendons=tendons or parameters.tendons)


def true_robot(robot: Robot, parameters: VirtualRobotParameters | None = None) -> TrueRobot:
    return draw(parameters or given(), robot, article()[1])


def horizontal() -> np.ndarray:
    """Gravity in soft_base of a horizontal robot."""
    return np.array([-GRAVITY, 0.0, 0.0])


def virtual_robot(parameters: VirtualRobotParameters | None = None, **options) -> VirtualRobot:
    robot, hardware = article()
    return VirtualRobot(parameters or given(), robot, hardware, **options)
