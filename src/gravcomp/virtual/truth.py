"""Ground truth of the virtual robot, for evaluation; no node of the control loop receives it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Truth:
    """True state of the virtual robot. In soft_base, SI; b backbone points, m cables, t contacts."""

    time: float  # s since the start
    tip_position: np.ndarray  # (3,)
    tip_orientation: np.ndarray  # (4,) x y z w
    backbone_position: np.ndarray  # (b, 3), at the stations of robot.effectors
    backbone_orientation: np.ndarray  # (b, 4)
    gravity: np.ndarray  # (3,) m/s^2
    base_orientation: np.ndarray  # (4,) world from soft_base
    displacement: np.ndarray  # (m,) wound in at the capstans
    shortened: np.ndarray  # (m,) by how much the paths in the robot are shorter than in the straight robot
    tension: np.ndarray  # (m,) N, at the capstans
    current: np.ndarray  # (m,) A, as last commanded
    temperature: float  # degC, of the chip
    recorded: bool  # whether the last IMU sample came from a recording
    base_position: np.ndarray  # (3,) m in the world
    contact_force: np.ndarray  # (t, 3) N, of the walls on the robot
    contact_depth: np.ndarray  # (t,) m, in the wall
    contact_place: np.ndarray  # (t, 3) m
    contact_obstacle: tuple[str, ...]  # t names
    hand_force: np.ndarray  # (3,) N, of a hand on the tip
    wall: tuple[np.ndarray, np.ndarray] | None  # point (3,) m and normal (3,) of the wall that a user has put there

    @property
    def wall_force(self) -> float:
        """Sum of the sizes of the walls' forces, N."""
        return float(np.linalg.norm(self.contact_force, axis=1).sum())
