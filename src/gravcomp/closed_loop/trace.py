"""Record of a run of the closed loop."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Trace:
    """One row for each IMU sample; t samples, b backbone points, m cables. In SI and soft_base; `model_`: of the simulator."""

    time: np.ndarray  # (t,)
    compensating: np.ndarray  # (t,) bool
    tip_position: np.ndarray  # (t, 3) true
    tip_direction: np.ndarray  # (t, 3) true
    backbone: np.ndarray  # (t, b, 3) true
    base_orientation: np.ndarray  # (t, 4) x y z w, true
    gravity: np.ndarray  # (t, 3) true
    tension: np.ndarray  # (t, m) true
    estimated_gravity: np.ndarray  # (t, 3)
    model_tip_position: np.ndarray  # (t, 3)
    model_tip_direction: np.ndarray  # (t, 3)
    command: np.ndarray  # (t, m)
    base_position: np.ndarray  # (t, 3) true, in the world
    wall_force: np.ndarray  # (t,) N, sum of the sizes of the walls' forces
    depth: np.ndarray  # (t,) m, of the robot in a wall, largest

    def between(self, start: float, end: float = np.inf) -> "Trace":
        """Return the rows with start <= time < end."""
        rows = (self.time >= start - 1e-9) & (self.time < end - 1e-9)
        return Trace(*(getattr(self, name)[rows] for name in Trace.__dataclass_fields__))
