"""How far the load has moved the model's tip, without motions to and fro.

What friction and hysteresis hold back follows the turning points of a motion. A motion to and fro that is smaller than the noise
of the tracker leaves it as it is; the corrections themselves are such motions. Counted, they would make the estimate less
certain, the next correction by a noisy measurement larger, and with it the motion that is counted.
"""

import numpy as np


class LoadChange:
    """The way of a point (3,), in m, of which it loses `slack` m at each turn (play operator)."""

    def __init__(self, slack: float):
        self._slack = slack
        self._followed: np.ndarray | None = None  # what the point pulls behind it at the length of the slack

    def moved(self, point: np.ndarray) -> float:
        """Return how far the point has moved on since the last call, in m; 0 within the slack, and at the first call."""
        if self._followed is None:
            self._followed = point
        distance = float(np.linalg.norm(point - self._followed))
        beyond = max(0.0, distance - self._slack)
        if beyond:
            self._followed = self._followed + beyond / distance * (point - self._followed)
        return beyond
