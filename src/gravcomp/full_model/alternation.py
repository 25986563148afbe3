"""Steps of Newton's method that alternate: each one goes back as far as the one before went ahead, and none is the last.

In contact with a rough surface the force on a place that moves along the robot changes sides with each step, so that the steps
turn back at constant size. As with a series of ratio r = -1, the limit lies between: a step d after a step d' is taken by

    w = d' . (d' - d) / |d' - d|^2

the factor of Aitken's extrapolation for vectors (B. M. Irons, R. C. Tuck, A version of the Aitken accelerator for computer
iteration, International Journal for Numerical Methods in Engineering 1, 1969), which for r = -1 is one half.
"""

import numpy as np

_BACK = 0.5  # of the step before: a step that goes back by more than this part of it alternates


class Alternation:
    """What part of each step of one equilibrium is taken."""

    def __init__(self) -> None:
        """Begin with the first step."""
        self.begin()

    def begin(self) -> None:
        """Begin a new equilibrium."""
        self._before: np.ndarray | None = None

    def part(self, step: np.ndarray) -> float:
        """Return the part of `step` (k,) to take, 1 unless it goes back from the step before."""
        before, self._before = self._before, step.copy()
        if before is None or float(step @ before) >= -_BACK * float(before @ before):
            return 1.0
        change = before - step
        return float(before @ change) / float(change @ change)
