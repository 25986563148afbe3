"""The simulator: a robot's shape under gravity and cables, and its linear response to the cables.

simulator = Simulator(load_robot_file("article").robot)
shape = simulator.step(gravity, displacement)      # tracking from the last shape, one call per control step
shape = simulator.solve(gravity, tension=tension)  # independent of the last shape
"""

from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Response, Shape, ShapeStatus
from gravcomp.simulation.dynamic_simulator import DynamicSimulator
from gravcomp.simulation.simulator import Simulator

__all__ = ["DynamicSimulator", "DynamicsOptions", "Response", "RobotModel", "Shape", "ShapeStatus", "Simulator"]
