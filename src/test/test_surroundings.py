"""Forbidden zones and the force on obstacles as bounds of the controller."""

import dataclasses

import numpy as np
import pytest
from arc_robot import LENGTH, STATIONS, ArcRobot, centre_line, description

from gravcomp.bench.contact_scenes import scene_of
from gravcomp.config import ConfigError, from_mapping
from gravcomp.contact.contacts import ObstacleForces
from gravcomp.inverse import ControllerCode, InverseController, InverseOptions, Target
from gravcomp.scene import SceneSection
from gravcomp.scene.scene import Scene

G = np.array([-9.81, 0.0, 0.0])
RADIUS = 4.5e-3
BALL = {"name": "vessel", "centre_mm": [14, 0, 70], "radius_mm": 4, "forbidden": True}


def zones_of(**kinds):
    return Scene(from_mapping(SceneSection, kinds, source="scene", key="scene"), forbidden=True)


def gap_of(zones, robot, gravity=G):
    """The smallest gap of the discs across the robot, which are its sections."""
    points, directions = centre_line(robot.q)
    gap, normal, _ = zones.nearest(points, zones.under_gravity(gravity))
    return (gap - RADIUS * np.sqrt(np.maximum(1.0 - (normal * directions).sum(axis=1) ** 2, 0.0))).min()


def held(zones, target, gravities):
    """Run the loop from the robot at rest; return the last command, and the gap to the zones at every step."""
    robot, controller = ArcRobot(), InverseController(description(), zones=zones)
    response, gaps = robot.step(gravities[0], None, iterations=20), []
    for gravity in gravities:
        command = controller.step(response, target, backbone_station=STATIONS, tension=robot.tension, gravity=gravity)
        response = robot.step(gravity, command.displacement)
        gaps.append(gap_of(zones, robot, gravity))
    return command, np.array(gaps)


def test_a_zone_between_the_robot_and_its_target_is_never_entered():
    """The target lies behind the zone: without it the tip comes there."""
    target = Target(np.array([0.035, 0.0, 0.088]))
    free, _ = held(zones_of(spheres=[BALL | {"centre_mm": [500, 0, 0]}]), target, [G] * 60)
    assert free.code == ControllerCode.OK
    command, gaps = held(zones_of(spheres=[BALL]), target, [G] * 120)
    assert gaps.min() > 0.0
    assert gaps[-1] < 1e-2 * LENGTH  # it comes as near as it may
    assert command.code == ControllerCode.ZONE
    assert "kept out of the forbidden zone 'vessel' at (" in command.message
    assert command.distance == pytest.approx(np.linalg.norm(command.tip - target.tip_position))


def test_the_tip_s_face_keeps_off_a_zone_ahead():
    """A small ball before the middle of the face, whose edge passes it."""
    ahead = zones_of(spheres=[{"centre_mm": [0, 0, 97], "radius_mm": 2, "forbidden": True}])
    target = Target(np.array([0.0, 0.0, 0.1]), tip_direction=np.array([0.0, 0.0, 1.0]), tip_direction_weight=0.01)
    robot, controller = ArcRobot(), InverseController(description(), zones=ahead)
    response = robot.step(np.zeros(3), np.full(6, 8e-3), iterations=20)
    controller.reset(np.full(6, 8e-3))  # pulled together: the tip is below the ball
    assert robot.response(G).effector_free is not None and centre_line(robot.q)[0][-1, 2] < 0.094
    for _ in range(60):
        command = controller.step(response, target, backbone_station=STATIONS, tension=robot.tension)
        response = robot.step(np.zeros(3), command.displacement)
        tip = centre_line(robot.q)[0][-1]
        across = np.hypot(*tip[:2])
        assert np.hypot(max(across - RADIUS, 0.0), 0.097 - tip[2]) > 2e-3 or across > RADIUS + 2e-3
    assert command.code == ControllerCode.ZONE


def test_a_zone_in_the_world_stays_while_the_robot_turns():
    below = zones_of(planes=[{"normal": [0, 0, 1], "point_mm": [0, 0, -12], "frame": "world", "forbidden": True}])
    turning = [9.81 * np.array([-np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0.0, 0.5, 80)]
    command, gaps = held(below, Target(np.array([-0.03, 0.0, 0.09])), turning)
    assert gaps[0] < -5e-3  # it sags into the zone before the cables hold it
    assert gaps[30:].min() > 0.0 and gaps[-1] < 1e-2 * LENGTH
    assert command.code == ControllerCode.ZONE


def test_a_robot_in_a_zone_says_so_and_is_led_out():
    zones = zones_of(planes=[{"name": "floor", "normal": [1, 0, 0], "point_mm": [-12, 0, 0], "forbidden": True}])
    target = Target(np.array([-0.02, 0.0, 0.095]))
    command, gaps = held(zones, target, [G])
    assert gaps[0] < -5e-3
    assert command.code == ControllerCode.ZONE
    assert "inside the forbidden zone 'floor' at (" in command.message
    assert command.message.endswith("it is led out")


def test_the_force_on_an_obstacle_is_bounded_and_one_that_is_too_large_is_lowered():
    """Two cables press; the programme takes what the bound allows of them, and says which obstacle bounds it."""
    robot = ArcRobot()
    response = robot.step(G, np.zeros(6), iterations=20)
    target = Target(np.array([0.03, 0.0, 0.09]))
    change = np.abs(response.compliance_ea[0]) * 5.0
    for present, expected in ((0.01, "is held"), (0.2, "lowered")):
        controller = InverseController(description(), InverseOptions(max_contact_force=0.02))
        forces = ObstacleForces(("wall",), np.array([present]), np.zeros((1, 3)), change[None])
        command = controller.step(
            response, target, backbone_station=STATIONS, tension=robot.tension, contact=forces, interval=0.1
        )
        after = present + change @ (command.tension - robot.tension)
        assert expected in command.message and "'wall'" in command.message
        if present < 0.02:
            assert after == pytest.approx(0.02, abs=1e-5)
            free = InverseController(description())
            free = free.step(response, target, backbone_station=STATIONS, tension=robot.tension, contact=forces, interval=0.1)
            assert present + change @ (free.tension - robot.tension) > 0.03
        else:
            assert after < present
            assert command.code == ControllerCode.CONTACT


@pytest.mark.parametrize(
    ("kinds", "message"),
    [
        ({"spheres": [BALL | {"friction": 0.2}]}, "friction is given, but a forbidden zone touches nothing"),
        ({"spheres": [BALL | {"centre_mm": [0, 0, -2]}]}, "starts .* inside 'vessel'"),
    ],
)
def test_a_zone_that_cannot_be_kept_is_refused(kinds, message):
    with pytest.raises(ConfigError, match=message):
        InverseController(description(), zones=zones_of(**kinds))


def test_zones_push_nothing_and_walls_are_no_zones():
    both = {"spheres": [BALL, BALL | {"name": "ball", "forbidden": False}]}
    assert zones_of(**both).names == ("vessel",)
    assert scene_of(**both).names == ("ball",)
    assert not dataclasses.replace(from_mapping(SceneSection, both, source="", key="").walls[0], forbidden=False).forbidden
