"""The full finite-element model of a robot with its cables, and the solvers of its equilibrium and its motion."""

from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Response, Shape, ShapeStatus

__all__ = ["DynamicsOptions", "Response", "RobotModel", "Shape", "ShapeStatus"]
