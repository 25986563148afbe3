"""What a camera or another tracker sees of the virtual robot's tip."""

from dataclasses import dataclass

import numpy as np

from gravcomp.config import parameter


@dataclass(frozen=True)
class Tracker:
    """White noise of each sample, in shares of the length: a camera is placed so that the robot fills its image."""

    position_share: float = parameter(
        1e-3, minimum=0.0, maximum=0.1, description="deviation of a coordinate of the tip, over the robot's length"
    )
    direction: float = parameter(0.5, edge="deg", minimum=0.0, maximum=45.0, description="deviation of the tip's direction")

    def seen(
        self, length: float, tip: np.ndarray, direction: np.ndarray, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return position (t, 3) in m and direction (t, 3) of the tip of a robot of `length` m, with noise."""
        position = tip + self.position_share * length * random.standard_normal(tip.shape)
        turned = direction + self.direction * random.standard_normal(tip.shape)
        return position, turned / np.linalg.norm(turned, axis=1, keepdims=True)
