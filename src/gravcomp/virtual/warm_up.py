"""Compilation of the virtual robot's kernels into the cache before the first run, which would otherwise wait half a minute."""

from gravcomp.config import from_mapping
from gravcomp.description.robot_file import load_robot_file
from gravcomp.scene.scene import Scene
from gravcomp.virtual.parameters import VirtualRobotParameters
from gravcomp.virtual.robot import VirtualRobot


def warm_up(scene: Scene | None = None) -> None:
    """Compile all kernels that the article's robot, in a scene if it is given, and the reading of its ground truth need."""
    file = load_robot_file("article")
    robot = VirtualRobot(from_mapping(VirtualRobotParameters, {}, source="defaults"), file.robot, file.hardware, scene=scene)
    robot.step(0.02)
    _ = robot.truth
