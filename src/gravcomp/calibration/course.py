"""Predicted motion of the tip over a measured course: gravity and cables as measured, tip from the model."""

from collections.abc import Iterator

import numpy as np

from gravcomp.calibration.measured import Measured
from gravcomp.calibration.one_mesh import model_of
from gravcomp.description import Robot
from gravcomp.full_model.modes import first_period
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.simulation import DynamicSimulator, DynamicsOptions, Shape, ShapeStatus

STRAIGHT = 0.02
"""A course starts at the shape at rest if its first tip is nearer than this share of the length to that of the shape."""
_STEPS = 55.0  # of time in the robot's first period: the error of a fall is then a thousandth of the robot's length


def course_options(robot: Robot) -> DynamicsOptions:
    """Return the options of predicted courses of a robot. Raises MeshError for a body that cannot be meshed."""
    return DynamicsOptions(time_step=first_period(robot) / _STEPS)


def predict_course(robot: Robot, course: Measured, options: DynamicsOptions | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return tip positions (t, 3) in m and directions (t, 3) at the course's times.

    options: default `course_options`. Raises RuntimeError if the start has no equilibrium or a time step does not converge.
    """
    at_rest = rest_tip(robot)
    rows = [
        at_rest if shape is None else (shape.tip_position, shape.tip_direction)
        for shape in predict_shapes(robot, course, options)
    ]
    tips, directions = zip(*rows)
    return np.array(tips), np.array(directions)


def predict_shapes(robot: Robot, course: Measured, options: DynamicsOptions | None = None) -> Iterator[Shape | None]:
    """Yield the shapes at the course's times, None for the start at the shape at rest; as `predict_course`."""
    simulator = DynamicSimulator(model_of(robot), options or course_options(robot))
    if np.linalg.norm(course.tip_position[0] - rest_tip(robot)[0]) > STRAIGHT * robot.length:
        shape = simulator.settle(course.gravity[0], course.displacement[0])
        if not shape.is_equilibrium:
            raise RuntimeError(f"the motion has no equilibrium to start from: {shape.message}")
        yield shape
    else:
        simulator.let_go(course.gravity[0])
        yield None
    for gravity, displacement, duration in zip(course.gravity[1:], course.displacement[1:], np.diff(course.time)):
        shape = simulator.step(gravity, displacement, duration=duration)
        if shape.status == ShapeStatus.NOT_CONVERGED:
            raise RuntimeError(f"the motion cannot be computed: {shape.message}")
        yield shape
