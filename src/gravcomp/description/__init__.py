"""The robot as data: a robot file (YAML) is read into frozen data classes and checked.

file = load_robot_file("article")      # a shipped robot by its name, or a path
file.robot.segments[0].length          # m
file.section("hardware")               # another section as a plain mapping
"""

from gravcomp.description.body import Cap, Elements, Material, MeshBody, Segment
from gravcomp.description.cable import Cable
from gravcomp.description.imu_mount import ImuMount
from gravcomp.description.limits import Limits
from gravcomp.description.robot import Effectors, Payload, Robot
from gravcomp.description.robot_file import RobotFile, load_robot_file, shipped_robots

__all__ = [
    "Cable", "Cap", "Effectors", "Elements", "ImuMount", "Limits", "Material", "MeshBody", "Payload", "Robot", "RobotFile",
    "Segment", "load_robot_file", "shipped_robots",
]  # fmt: skip
