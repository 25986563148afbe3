"""Keep a robot straight while gravity turns: the loop of model and inverse problem, without ROS and without a clock.

Each step linearises the model at its current shape,

    effector = W_ea lambda + effector_free,    displacement = W_aa lambda + displacement_free,

and finds the tensions whose effector is nearest to the target (see gravcomp.inverse.programme).
"""

import numpy as np

from gravcomp.description import load_robot_file
from gravcomp.inverse import InverseController, straight_target
from gravcomp.simulation import Simulator

STEP = 0.01  # s, as in the running graph
robot = load_robot_file("article").robot
simulator, controller = Simulator(robot), InverseController(robot)
target = straight_target(robot.length, tip_direction_weight=1e-3)  # m^2: 0.1 rad counts like 3 mm


def gravity_at(time: float) -> np.ndarray:
    """Return gravity (3,) in m/s^2 in soft_base: horizontal robot for half a second, then a rotation about y at 30 deg/s."""
    angle = np.radians(30.0) * max(0.0, time - 0.5)
    return 9.81 * np.array([-np.cos(angle), 0.0, np.sin(angle)])


shape = simulator.solve(gravity_at(0.0))
print(f"released: the tip sags by {1e3 * np.linalg.norm(shape.tip_position - target.tip_position):.2f} mm")

for step in range(150):
    command = controller.step(
        shape.response,
        target,
        backbone_station=shape.backbone_station,
        tension=shape.cable_tension,
        interval=STEP,
    )
    shape = simulator.step(gravity_at(step * STEP), command.displacement)
    if step % 25 == 24:
        x, y, z = 1e3 * (shape.tip_position - target.tip_position)
        print(f"{(step + 1) * STEP:4.2f} s: lateral {np.hypot(x, y):6.3f} mm, axial {z:+6.3f} mm, {command.code.name}")

print(f"\nat the end, {shape.model} model:")
for name, u, tension in zip(robot.cable_names, command.displacement, shape.cable_tension):
    print(f"  {name}: displacement {1e3 * u:+6.3f} mm, tension {tension:.3f} N")
