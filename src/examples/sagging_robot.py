"""Compute how far a soft robot sags: its static equilibrium under gravity, with released cables and with one pulled cable.

f_int(u) = f_weight(g) + H(u)^T lambda,    lambda >= 0        (gravcomp.full_model.statics)
"""

import numpy as np

from gravcomp.description import load_robot_file
from gravcomp.simulation import Simulator

robot = load_robot_file("article").robot
simulator = Simulator(robot)
straight = np.array([0.0, 0.0, robot.length])  # tip without gravity, m, in soft_base: z from base to tip

g = 9.81
directions = {"horizontal": [-g, 0, 0], "45 deg down": [-g / np.sqrt(2), 0, g / np.sqrt(2)], "hanging": [0, 0, g]}

for name, gravity in directions.items():
    shape = simulator.solve(np.array(gravity, dtype=float))  # neither displacement nor tension given: all cables are released
    x, _, z = 1e3 * (shape.tip_position - straight)
    print(f"{name:12s} tip moves by {x:+7.2f} mm across and {z:+6.2f} mm along; residual {shape.residual:.1e} N")

tension = np.zeros(len(robot.cables))
tension[robot.cable_names.index("s2c1")] = 0.3  # N
pulled = simulator.solve(np.array([-g, 0.0, 0.0]), tension=tension)
print("\nhorizontal, s2c1 pulled with 0.3 N: tip at", np.round(1e3 * pulled.tip_position, 2), "mm")
for name, displacement in zip(robot.cable_names, pulled.cable_displacement):
    print(f"  {name}: displacement {1e3 * displacement:+.2f} mm")
