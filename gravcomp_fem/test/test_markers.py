"""The markers for RViz show the surface of the described body, and its cables."""

import numpy as np
import pytest
from gravcomp_fem.markers import RobotMarkers
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from gravcomp.description import Cable, Robot, Section, Segment
from gravcomp.simulation import Response, Shape


def straight(robot: Robot) -> Shape:
    """The straight robot, as a shape."""
    points, cables = 5, len(robot.cables)
    station = np.linspace(0, 1, points)
    rows = 6 + 3 * points
    return Shape(
        tip_position=np.array([0.0, 0.0, robot.length]),
        tip_orientation=np.array([0.0, 0.0, 0.0, 1.0]),
        backbone_station=station,
        backbone_position=np.column_stack([0 * station, 0 * station, station * robot.length]),
        backbone_orientation=np.tile([0.0, 0.0, 0.0, 1.0], (points, 1)),
        cable_displacement=np.zeros(cables),
        cable_tension=np.ones(cables),
        gravity=np.array([0.0, 0.0, -9.81]),
        response=Response(np.eye(cables), np.zeros((rows, cables)), np.zeros(cables), np.zeros(rows)),
        residual=0.0,
        error_estimate=0.0,
        solve_time=1e-3,
        model="full",
    )


def test_a_rectangular_body_is_shown_as_it_is():
    segment = Segment("a", 0.1, section=Section("rectangle", 10e-3, 6e-3, tip_width=5e-3))
    robot = Robot("r", segments=(segment,), cables=(Cable("c", 0.0, 2e-3, segment="a", follow_taper=True),))
    gravity = np.array([0.0, 0.0, -9.81])
    body, cable, arrow = RobotMarkers(robot).of(straight(robot), Header(frame_id="soft_base"), gravity).markers
    assert arrow.points[1].z == pytest.approx(-0.04), "0.4 of the robot's length"
    assert body.type == Marker.TRIANGLE_LIST and len(body.points) % 3 == 0
    points = np.array([[p.x, p.y, p.z] for p in body.points])
    assert np.abs(points).max(axis=0) == pytest.approx([5e-3, 3e-3, 0.1], rel=1e-6)
    near_tip = points[(points[:, 2] > 0.095) & (points[:, 2] < 0.099)]
    assert np.abs(near_tip[:, 0]).max() < 2.7e-3
    assert [cable.points[0].x, cable.points[-1].x] == pytest.approx([2e-3, 1e-3], rel=1e-5)
