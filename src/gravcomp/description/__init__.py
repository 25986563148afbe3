"""The robot as data: a robot file (YAML) is read into frozen data classes and checked.

file = load_robot_file("article")      # a shipped robot by its name, or a path
file.robot.segments[0].length          # m
file.section("hardware")               # another section as a plain mapping
"""

from gravcomp.description.blended_outline import BlendedOutline
from gravcomp.description.body import Cap, Elements, Fibres, Material, PronyTerm
from gravcomp.description.cable import Cable
from gravcomp.description.cable_line import CableLine
from gravcomp.description.disks import Disks
from gravcomp.description.imu_mount import ImuMount
from gravcomp.description.limits import Limits
from gravcomp.description.max_wrench import MaxWrench
from gravcomp.description.mesh_body import MeshBody, Transform
from gravcomp.description.outline import Outline
from gravcomp.description.pieces import Piece
from gravcomp.description.point_load import PointLoad
from gravcomp.description.rest_shape import RestShape
from gravcomp.description.robot import Effectors, Payload, Robot
from gravcomp.description.robot_file import RobotFile, load_robot_file, shipped_robots
from gravcomp.description.section import Lumen, Section, Station
from gravcomp.description.section_moments import SectionMoments, section_moments
from gravcomp.description.segment import Segment
from gravcomp.description.spring import Spring

__all__ = [
    "BlendedOutline", "Cable", "CableLine", "Cap", "Disks", "Effectors", "Elements", "Fibres", "ImuMount", "Limits", "Lumen",
    "Material", "MaxWrench", "MeshBody", "Outline", "Payload", "Piece", "PointLoad", "PronyTerm", "RestShape", "Robot",
    "RobotFile", "Section", "SectionMoments", "Segment", "Spring", "Station", "Transform", "load_robot_file", "section_moments",
    "shipped_robots",
]  # fmt: skip
