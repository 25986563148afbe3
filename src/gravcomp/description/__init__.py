"""The robot as data: one YAML file, read into frozen data classes and checked.

file = load_robot_file("article")      # a shipped robot by its name, or a path
file.robot.segments[0].length          # m
file.section("hardware")               # a top-level section as a plain mapping, for its owner to parse
"""

from gravcomp.description.robot import (
    Cable,
    Cap,
    Effectors,
    Elements,
    ImuMount,
    Limits,
    Material,
    MeshBody,
    Payload,
    Robot,
    Segment,
)
from gravcomp.description.robot_file import RobotFile, load_robot_file, shipped_robots

__all__ = [
    "Cable", "Cap", "Effectors", "Elements", "ImuMount", "Limits", "Material", "MeshBody", "Payload", "Robot", "RobotFile",
    "Segment", "load_robot_file", "shipped_robots",
]  # fmt: skip
