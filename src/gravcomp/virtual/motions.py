"""Choice of the motion of the base by the parameters of the node."""

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.graph.parameters.virtual_robot import VirtualRobotNodeParameters
from gravcomp.recordings.imu import read_recording
from gravcomp.virtual.motion import (
    BaseMotion,
    FollowedMotion,
    RotationMotion,
    StaticMotion,
    TremorMotion,
    arm_poses,
    base_orientation,
    tilting,
)
from gravcomp.virtual.recorded_motion import RecordedMotion


def make_motion(parameters: VirtualRobotNodeParameters, mount: np.ndarray, seed: int) -> BaseMotion:
    """Return the motion that the parameters name; mount (3, 3): soft_base from imu_link; seed: of the tremor.

    Raises ConfigError where the recording is not named, RecordingError where it cannot be used.
    """
    start = base_orientation(parameters.inclination, parameters.roll)
    if parameters.motion == "recording":
        if not parameters.recording:
            raise ConfigError("virtual_robot: motion is 'recording' and 'recording' is empty; a file or folder is needed")
        return RecordedMotion(read_recording(parameters.recording), mount, parameters.recording_start)
    if parameters.motion == "rotation":
        axis = {"vertical": start.T @ [0.0, 0.0, 1.0], "robot": np.array([0.0, 0.0, 1.0]), "across": np.array([0.0, 1.0, 0.0])}
        return RotationMotion(start, axis[parameters.axis], parameters.rate, parameters.hold)
    if parameters.motion == "tilt":
        return tilting(parameters.hold, parameters.rate)
    if parameters.motion == "arm":
        return arm_poses(parameters.hold, parameters.rate)
    if parameters.motion == "tremor":
        return TremorMotion(start, seed)
    if parameters.motion == "topic":
        return FollowedMotion(start)
    return StaticMotion(start)
