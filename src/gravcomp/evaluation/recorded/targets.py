"""Targets of a recorded run over time, as the controller took them from `target` and `target/shape`."""

import numpy as np

from gravcomp.calibration.bag import direction_of_poses
from gravcomp.description import Robot
from gravcomp.evaluation.recorded.course import last_known
from gravcomp.inverse import TargetError, bend_target
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.recordings.bags.streams import Stream


def targets_over(time: np.ndarray, poses: Stream | None, shapes: Stream | None, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return target positions (t, 3) m and directions (t, 3) of the tip at the times (t,) s; at rest before the first message.

    poses, shapes: messages of `target` and of `target/shape`, None without any; robot: the modelled one.
    """
    received, rows = [], []
    for stream, target in ((poses, _pose_target), (shapes, _shape_target)):
        for moment, values in zip(stream.received, stream.values) if stream else ():
            try:
                rows.append(target(values, robot.length))
                received.append(moment)
            except TargetError:  # the controller refused it, too
                continue
    order = np.argsort(received, kind="stable")
    first = np.concatenate(rest_tip(robot))
    targets = last_known(time, np.array(received)[order], np.array(rows).reshape(-1, 6)[order], first)
    return targets[:, :3], targets[:, 3:]


def _pose_target(values: np.ndarray, length: float) -> np.ndarray:
    return np.concatenate([values[:3], direction_of_poses(values[None, :])[0]])


def _shape_target(values: np.ndarray, length: float) -> np.ndarray:
    bend, angle, plane, *points = values
    if bend:
        target = bend_target(length, angle, plane)
        return np.concatenate([target.tip_position, target.tip_direction])
    direction = np.array(points[3:])
    norm = np.linalg.norm(direction)
    # Without a target direction, lateral means across the axis of the straight robot.
    return np.concatenate([points[:3], direction / norm if norm > 0.0 else [0.0, 0.0, 1.0]])
