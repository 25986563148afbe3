"""The simulator: a robot's shape under gravity and cables, and how it answers to the cables.

simulator = Simulator(load_robot_file("article").robot)
shape = simulator.step(gravity, displacement)      # warm-started tracking, one call a control step
shape = simulator.solve(gravity, tension=tension)  # from far away, as exactly as asked for
"""

from gravcomp.full_model.generalized_alpha import DynamicsOptions
from gravcomp.full_model.model import RobotModel
from gravcomp.full_model.shape import Response, Shape, ShapeStatus
from gravcomp.simulation.dynamic_simulator import DynamicSimulator
from gravcomp.simulation.simulator import Simulator

__all__ = ["DynamicSimulator", "DynamicsOptions", "Response", "RobotModel", "Shape", "ShapeStatus", "Simulator"]
