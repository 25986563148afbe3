"""Markers of the deformed robot for RViz: body, cables coloured by tension, gravity."""

import math

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from gravcomp.description import Cable, Robot
from gravcomp.simulation import Shape

_BODY = (0.85, 0.80, 0.72, 0.6)
_GRAVITY = (0.2, 0.3, 0.9, 1.0)
_GRAVITY_LENGTH = 0.04  # m, of the arrow for 9.81 m/s^2


def markers_of(shape: Shape, robot: Robot, header: Header) -> MarkerArray:
    """Return the body as spheres along the backbone, one line per cable and the gravity arrow, all in `header.frame_id`."""
    diameter = max(segment.outer_diameter for segment in robot.segments) if robot.segments else 0.009
    body = _marker(header, "body", 0, Marker.SPHERE_LIST, _BODY, diameter)
    body.scale.y = body.scale.z = diameter
    body.points = [_point(p) for p in _dense(shape.backbone_position)]
    cables = [_cable(header, i, shape, robot) for i in range(len(robot.cables))]
    arrow = _marker(header, "gravity", 0, Marker.ARROW, _GRAVITY, 0.002)
    arrow.scale.y, arrow.scale.z = 0.005, 0.008
    arrow.points = [_point(np.zeros(3)), _point(shape.gravity / 9.81 * _GRAVITY_LENGTH)]
    return MarkerArray(markers=[body, *cables, arrow])


def _cable(header: Header, index: int, shape: Shape, robot: Robot) -> Marker:
    # Blue: slack; red: a quarter of the limit or more, because compensation uses tensions far below the limit.
    heat = min(1.0, 4.0 * shape.cable_tension[index] / robot.limits.tension_max)
    marker = _marker(header, "cables", index, Marker.LINE_STRIP, (heat, 0.2, 1.0 - heat, 1.0), 0.0007)
    cable = robot.cables[index]
    for station, position, orientation in zip(shape.backbone_station, shape.backbone_position, shape.backbone_orientation):
        z = station * robot.length
        if cable.start - 1e-9 <= z <= robot.cable_end(cable) + 1e-9:
            marker.points.append(_point(position + _rotate(orientation, _offset(cable, z))))
    return marker


def _offset(cable: Cable, z: float) -> np.ndarray:
    """Return the position (x, y, 0) of the cable in the axes of the cross-section at z (m)."""
    if cable.via_points is not None:
        via = np.array(cable.via_points)
        return np.array([np.interp(z, via[:, 2], via[:, 0]), np.interp(z, via[:, 2], via[:, 1]), 0.0])
    return cable.radius * np.array([math.cos(cable.angle), math.sin(cable.angle), 0.0])


def _marker(header: Header, namespace: str, index: int, kind: int, colour: tuple, width: float) -> Marker:
    marker = Marker(header=header, ns=namespace, id=index, type=kind, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale.x = width
    marker.color = ColorRGBA(r=float(colour[0]), g=float(colour[1]), b=float(colour[2]), a=float(colour[3]))
    return marker


def _dense(points: np.ndarray, between: int = 4) -> np.ndarray:
    index = np.linspace(0, len(points) - 1, (len(points) - 1) * between + 1)
    return np.stack([np.interp(index, np.arange(len(points)), points[:, i]) for i in range(3)], axis=1)


def _rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    t = 2.0 * np.cross(q[:3], v)
    return v + q[3] * t + np.cross(q[:3], t)


def _point(p: np.ndarray) -> Point:
    return Point(x=float(p[0]), y=float(p[1]), z=float(p[2]))
