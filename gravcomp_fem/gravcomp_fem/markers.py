"""Markers of the deformed robot for RViz: body, cables coloured by tension, gravity."""

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from gravcomp.description import Robot
from gravcomp.simulation import Shape
from gravcomp.view.backbone import Backbone
from gravcomp.view.colours import tension_scale
from gravcomp.view.skin import cable_line, half_width, merged
from gravcomp.view.wall import wall_skins

_BODY = (0.85, 0.80, 0.72, 0.6)
_GRAVITY = (0.2, 0.3, 0.9, 1.0)
_GRAVITY_LENGTH = 0.4  # of the arrow for 9.81 m/s^2, over the robot's length
_SHAFT, _HEAD = 0.02, (0.05, 0.08)  # the arrow's diameters and the length of its head, over the robot's length
# Vertices around the body and along the robot.
_AROUND, _RINGS = 16, 24


class RobotMarkers:
    """The markers of one robot."""

    def __init__(self, robot: Robot):
        self._robot = robot
        self._skin = merged(wall_skins(robot, _AROUND, _RINGS))
        self._lines = [cable_line(robot, cable) for cable in robot.cables]
        self._cable_width = 0.15 * half_width(robot)

    def of(self, shape: Shape, header: Header, gravity: np.ndarray) -> MarkerArray:
        """Return the body's surface, one line per cable and the arrow of gravity (3,) in m/s^2, all in `header.frame_id`."""
        backbone = Backbone(shape.backbone_station, shape.backbone_position, shape.backbone_orientation)
        body = _marker(header, "body", 0, Marker.TRIANGLE_LIST, _BODY, 1.0)
        body.scale.y = body.scale.z = 1.0
        vertices = [_point(p) for p in self._skin.on(backbone)]
        body.points = [vertices[index] for index in self._skin.faces.ravel()]
        cables = [self._cable(header, i, shape, backbone) for i in range(len(self._robot.cables))]
        length = self._robot.length
        arrow = _marker(header, "gravity", 0, Marker.ARROW, _GRAVITY, _SHAFT * length)
        arrow.scale.y, arrow.scale.z = (share * length for share in _HEAD)
        arrow.points = [_point(np.zeros(3)), _point(gravity / 9.81 * _GRAVITY_LENGTH * length)]
        return MarkerArray(markers=[body, *cables, arrow])

    def _cable(self, header: Header, index: int, shape: Shape, backbone: Backbone) -> Marker:
        heat = min(1.0, shape.cable_tension[index] / tension_scale(self._robot))  # blue: slack
        marker = _marker(header, "cables", index, Marker.LINE_STRIP, (heat, 0.2, 1.0 - heat, 1.0), self._cable_width)
        marker.points = [_point(p) for p in self._lines[index].on(backbone)]
        return marker


def _marker(header: Header, namespace: str, index: int, kind: int, colour: tuple, width: float) -> Marker:
    marker = Marker(header=header, ns=namespace, id=index, type=kind, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = width
    marker.color = ColorRGBA(r=float(colour[0]), g=float(colour[1]), b=float(colour[2]), a=float(colour[3]))
    return marker


def _point(p: np.ndarray) -> Point:
    return Point(x=float(p[0]), y=float(p[1]), z=float(p[2]))
