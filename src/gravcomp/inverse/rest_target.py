"""Targets from a robot's shape at rest: that shape, which its cables keep unless told otherwise, and the same bent further."""

import numpy as np

from gravcomp.description import Robot
from gravcomp.inverse.target import Target, bend_target
from gravcomp.mesh.robot_axis import rest_axis


def rest_target(
    robot: Robot,
    angle: float = 0.0,
    plane: float = 0.0,
    *,
    tip_position_weight: float = 1.0,
    tip_direction_weight: float = 0.0,
    backbone_station: np.ndarray | tuple[float, ...] = (),
    backbone_weight: np.ndarray | tuple[float, ...] = (),
) -> Target:
    """Return the target of the robot's shape at rest, bent further by `angle` rad in the plane at `plane` rad about z.

    That is `bend_target` for a robot that is straight at rest. Raises TargetError as it does, MeshError for a body that cannot be
    read.
    """
    weights = {"tip_position_weight": tip_position_weight, "tip_direction_weight": tip_direction_weight}
    straight = bend_target(
        robot.length, angle, plane, **weights, backbone_station=backbone_station, backbone_weight=backbone_weight
    )
    axis = rest_axis(robot)
    if not axis.bent:
        return straight
    position, rotation = axis.bent_further(angle, plane).frames(robot.length * np.append(straight.backbone_station, 1.0))
    return Target(
        tip_position=position[-1],
        tip_direction=rotation[-1, :, 2],
        **weights,
        backbone_station=straight.backbone_station,
        backbone_position=position[:-1],
        backbone_weight=straight.backbone_weight,
    )
