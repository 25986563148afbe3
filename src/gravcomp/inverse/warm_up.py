"""Compilation of the controller's functions before the first command.

It takes half a minute on a new machine. During this time the motors would get only stale commands.
"""

from dataclasses import replace

import numpy as np

from gravcomp.contact.contacts import ObstacleForces
from gravcomp.description import Robot
from gravcomp.description.transmission import Transmission
from gravcomp.full_model.shape import Response
from gravcomp.inverse.controller import InverseController
from gravcomp.inverse.options import InverseOptions
from gravcomp.inverse.target import straight_target
from gravcomp.scene import PlaneWall, SceneSection
from gravcomp.scene.scene import Scene


def warm_up(
    robot: Robot, options: InverseOptions | None = None, transmission: Transmission | None = None, surrounded: bool = False
) -> None:
    """Compile, or load from the cache, all functions that a command for the robot needs. options: default `InverseOptions()`.

    surrounded: also those for obstacles and zones around it, which take half as long again.
    """
    m, stations = len(robot.cables), np.linspace(0.0, 1.0, 3)
    if not m:
        return
    controller = InverseController(robot, options, transmission)
    points = np.linspace(0.0, robot.length, len(stations))[:, None] * [0.0, 0.0, 1.0]
    effector = np.concatenate([points[-1], [0.0, 0.0, 1.0], points.ravel()])
    # Arbitrary numbers with the types and the memory layout of a real response.
    compliance = np.sin(np.arange(effector.size * m, dtype=float)).reshape(effector.size, m)
    response = Response(1e-3 * np.eye(m), 1e-3 * compliance, np.zeros(m), effector)
    target = straight_target(robot.length, tip_direction_weight=1e-3, backbone_station=[0.5], backbone_weight=[0.1])
    for tension in (None, np.zeros(m)):
        controller.step(response, target, backbone_station=stations, tension=tension)
    controller.relax(response)
    if surrounded:  # wherever the obstacle is
        plane = PlaneWall(name="far", normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, -10.0 * robot.length), forbidden=True)
        zones = Scene(SceneSection(planes=(plane,)), forbidden=True)
        InverseController(robot, options, transmission, zones=zones).step(response, target, backbone_station=stations)
        wall = replace(plane, forbidden=False)
        touching = InverseController(robot, options, transmission, scene=Scene(SceneSection(planes=(wall,))))
        pressed = ObstacleForces(("far",), np.ones(1), np.zeros((1, 3)), np.full((1, m), 0.1))
        beyond = straight_target(2.0 * robot.length)
        for _ in range(2):  # the first command misses the target, so that the second one lets the robot go
            touching.step(response, beyond, backbone_station=stations, contact=pressed)
