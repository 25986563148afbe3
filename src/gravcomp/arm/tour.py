"""Tour of an arm through poses: joint positions over time.

Between two poses all joints follow the minimum-jerk polynomial  s(x) = 10 x^3 - 15 x^4 + 6 x^5  over the same time.
"""

from dataclasses import dataclass

import numpy as np

FIVE_POSES = {
    135.0: (0.0, -0.6, 0.0, -0.9, 0.0, 0.7145, 0.0),
    90.0: (0.0, 0.3, 0.0, -0.9, 0.0, 0.6, 0.0),
    45.0: (0.3, 0.3, 0.0, 0.6, 0.0, -0.1145, 0.0),
    0.0: (0.3, 0.5, 0.0, 0.8, 0.0, 0.2708, 0.0),
    -45.0: (0.0, 0.6, 0.0, 1.0, 0.0, 0.7562, 0.0),
}
"""The article's five directions of the robot (degrees above the horizontal) -> joint positions (rad) of the seven-axis arm."""


@dataclass(frozen=True)
class Tour:
    """Poses (p, j) in rad, visited in order: `travel` s to each pose, then `hold` s at rest."""

    poses: np.ndarray
    travel: float
    hold: float

    @property
    def duration(self) -> float:
        """Duration of one pass (s)."""
        return len(self.poses) * (self.travel + self.hold)

    def positions(self, time: float) -> np.ndarray:
        """Return the joint positions (j,) in rad at `time` s. The tour starts from the last pose and repeats without a jump."""
        leg, into = divmod(time, self.travel + self.hold)
        index = int(leg) % len(self.poses)
        x = min(1.0, into / self.travel)
        s = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        before = self.poses[index - 1]
        return before + s * (self.poses[index] - before)

    def at_rest(self, time: float, settled: float) -> int | None:
        """Return the index of the pose that has been held for at least `settled` s at `time`, or None; below 0: it is reached."""
        leg, into = divmod(time, self.travel + self.hold)
        return int(leg) % len(self.poses) if into >= self.travel + max(settled, 0.0) else None
