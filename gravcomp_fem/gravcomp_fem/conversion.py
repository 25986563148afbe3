"""Conversion between the core's shapes and targets and their messages."""

from array import array

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseArray, Vector3
from gravcomp_node.array_fields import doubles
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header

from gravcomp.contact.contacts import ObstacleForces
from gravcomp.inverse import Target, TargetError, bend_target
from gravcomp.simulation import Response, Shape
from gravcomp.view.backbone import Backbone
from gravcomp_msgs.msg import Deformation, ShapeTarget


def seconds(header: Header) -> float:
    """Return the stamp of a header in s."""
    return (header.stamp.sec * 1_000_000_000 + header.stamp.nanosec) * 1e-9


def vector_of(message: Point | Vector3) -> np.ndarray:
    """Return x, y, z (3,) of a message."""
    return np.array([message.x, message.y, message.z])


def deformation_message(shape: Shape, header: Header, turn: np.ndarray | None = None) -> Deformation:
    """Return the message of a shape.

    header: stamp of the IMU sample, and base frame; turn (3,) m/s^2: what a turning base adds to gravity in the shape's load.
    """
    message = Deformation(header=header, status=int(shape.status), message=shape.message, model=shape.model)
    message.tip = pose_message(shape.tip_position, shape.tip_orientation)
    gravity, added = (shape.gravity, np.zeros(3)) if turn is None else (shape.gravity - turn, turn)
    for field, vector in ((message.gravity, gravity), (message.turn_acceleration, added)):
        field.x, field.y, field.z = map(float, vector)
    message.backbone_station = doubles(shape.backbone_station)
    message.backbone_position = doubles(shape.backbone_position)
    message.backbone_orientation = doubles(shape.backbone_orientation)
    message.cable_displacement = doubles(shape.cable_displacement)
    message.cable_tension = doubles(shape.cable_tension)
    message.compliance_aa = doubles(shape.response.compliance_aa)
    message.compliance_ea = doubles(shape.response.compliance_ea)
    message.cable_displacement_free = doubles(shape.response.displacement_free)
    message.effector_free = doubles(shape.response.effector_free)
    message.residual = float(shape.residual)
    message.error_estimate = float(shape.error_estimate)
    message.solve_time = float(shape.solve_time)
    contact = shape.contacts.by_obstacle()
    message.contact_obstacle = list(contact.names)
    message.contact_force = doubles(contact.force)
    message.contact_position = doubles(contact.position)
    message.contact_force_change = doubles(contact.change)
    return message


def contact_of(message: Deformation) -> ObstacleForces:
    """Return the obstacles that a message names. Raises ValueError when its arrays do not match, or a number is not finite."""
    count, cables = len(message.contact_obstacle), len(message.cable_tension)
    return ObstacleForces(
        names=tuple(message.contact_obstacle),
        force=_matrix(message.contact_force, 1, count, "contact_force")[0],
        position=_matrix(message.contact_position, count, 3, "contact_position"),
        change=_matrix(message.contact_force_change, count, cables, "contact_force_change"),
    )


def gravity_of(message: Deformation) -> np.ndarray:
    """Return the gravity (3,) in m/s^2 of a message. Raises ValueError when it is not finite."""
    return _matrix(vector_of(message.gravity), 1, 3, "gravity")[0]


def response_of(message: Deformation) -> Response:
    """Return the linearised response in a message.

    Raises ValueError when the sizes of its arrays do not match, a number is not finite, or the compliance of a cable is not
    positive.
    """
    cables, points = len(message.cable_tension), len(message.backbone_station)
    rows = 6 + 3 * points
    response = Response(
        compliance_aa=_matrix(message.compliance_aa, cables, cables, "compliance_aa"),
        compliance_ea=_matrix(message.compliance_ea, rows, cables, "compliance_ea"),
        displacement_free=_matrix(message.cable_displacement_free, 1, cables, "cable_displacement_free")[0],
        effector_free=_matrix(message.effector_free, 1, rows, "effector_free")[0],
    )
    _matrix(message.cable_tension, 1, cables, "cable_tension")
    check_compliance(response)
    return response


def check_compliance(response: Response) -> None:
    """Raise ValueError when the compliance of a cable is not positive."""
    if not (np.diagonal(response.compliance_aa) > 0.0).all():
        raise ValueError(
            f"the diagonal of compliance_aa is {np.diagonal(response.compliance_aa)}; positive numbers (m/N) are needed"
        )


def backbone_of(message: Deformation) -> Backbone | None:
    """Return the backbone in a message, or None when it is not valid."""
    station = np.array(message.backbone_station)
    position, orientation = np.array(message.backbone_position), np.array(message.backbone_orientation)
    if station.size < 2 or position.size != 3 * station.size or orientation.size != 4 * station.size:
        return None
    if not (np.isfinite(position).all() and np.isfinite(orientation).all() and (np.diff(station) > 0.0).all()):
        return None
    return Backbone(station, position.reshape(-1, 3), orientation.reshape(-1, 4))


def backbone_of_poses(message: PoseArray) -> Backbone | None:
    """Return the backbone given as poses from base to tip, or None for fewer than two different poses."""
    pairs = [(pose.position, pose.orientation) for pose in message.poses]
    rows = np.array([[p.x, p.y, p.z, q.x, q.y, q.z, q.w] for p, q in pairs]).reshape(-1, 7)
    along = np.cumsum(np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1))
    if not len(along) or not np.isfinite(rows).all() or (np.diff(along, prepend=0.0) <= 0.0).any():
        return None
    return Backbone(np.append(0.0, along / along[-1]), rows[:, :3], rows[:, 3:])


def bend_message(angle: float, plane: float, tip_direction_weight: float, frame: str) -> ShapeTarget:
    """Return a target of constant curvature: `angle` (rad) between base and tip direction, in the plane at `plane` (rad)."""
    message = ShapeTarget(
        bend=True, bend_angle=angle, bend_plane=plane, tip_position_weight=1.0, tip_direction_weight=tip_direction_weight
    )
    message.header.frame_id = frame
    return message


def point_message(position: np.ndarray) -> Point:
    """Return a point; position (3,) in m."""
    x, y, z = map(float, position)
    return Point(x=x, y=y, z=z)


def pose_message(position: np.ndarray, orientation: np.ndarray) -> Pose:
    """Return a pose; position (3,) in m, orientation (4,) as x y z w."""
    pose = Pose()
    pose.position.x, pose.position.y, pose.position.z = map(float, position)
    o = pose.orientation
    o.x, o.y, o.z, o.w = map(float, orientation)
    return pose


def shape_target(message: ShapeTarget, length: float) -> Target:
    """Return the target in a message, for a robot of `length` (m). Raises TargetError when it is not valid."""
    stations = np.array(message.backbone_station, dtype=float)
    weights = np.array(message.backbone_weight, dtype=float)
    if message.bend:
        return bend_target(
            length,
            message.bend_angle,
            message.bend_plane,
            tip_position_weight=message.tip_position_weight,
            tip_direction_weight=message.tip_direction_weight,
            backbone_station=stations,
            backbone_weight=weights,
        )
    direction = vector_of(message.tip_direction)
    points = np.array([[p.x, p.y, p.z] for p in message.backbone_position], dtype=float).reshape(-1, 3)
    return Target(
        tip_position=vector_of(message.tip_position),
        tip_position_weight=message.tip_position_weight,
        # A message has no None: a direction of length zero means that none is given.
        tip_direction=direction if direction.any() or message.tip_direction_weight > 0.0 else None,
        tip_direction_weight=message.tip_direction_weight,
        backbone_station=stations,
        backbone_position=points,
        backbone_weight=weights,
    )


def pose_target(pose: Pose, position_weight: float, direction_weight: float) -> Target:
    """Return the target of a tip pose, whose z axis is the direction. Raises TargetError for an orientation without unit norm."""
    q = np.array([pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w])
    norm = np.linalg.norm(q)
    if not abs(norm - 1.0) < 1e-2:
        raise TargetError(f"the target's orientation has the norm {norm:g}; a unit quaternion is needed")
    return Target(
        tip_position=vector_of(pose.position),
        tip_position_weight=position_weight,
        tip_direction=Rotation.from_quat(q).apply((0.0, 0.0, 1.0)),
        tip_direction_weight=direction_weight,
    )


def _matrix(field: array | np.ndarray, rows: int, columns: int, name: str) -> np.ndarray:
    values = np.frombuffer(field, dtype=np.float64)
    if values.size != rows * columns:
        raise ValueError(f"{name} has {values.size} numbers; {rows} x {columns} are needed")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} has numbers that are not finite")
    return values.reshape(rows, columns)
