"""Damping of the steps where the model's linear answer does not carry: the steps of the closed loop are Gauss-Newton's, and
those overshoot, back and forth, where the target is missed by far or the robot is bent a lot.

The factor of the proximal term doubles twice for a step that undoes a good part of the one before, and falls slowly
while steps agree, as in Levenberg's and Marquardt's method; the sign of agreement is that of successive changes of
displacement, because the loop has no other trial.
"""

_LARGEST = 1e4
# A change below this is noise of the gravity's direction, not an overshoot.
_SMALLEST_CHANGE = 5e-6
_BACK_AND_FORTH = -0.3


class StepDamping:
    """Keeps the factor (1 or more) of the proximal term from one step to the next."""

    def __init__(self):
        self.factor = 1.0

    def observe(self, along: float, lengths: float) -> None:
        """Take in the changes of path displacement (m,) that the last two programmes asked for: their scalar product and the product of
        their lengths, m^2.
        """
        if lengths <= _SMALLEST_CHANGE**2:
            return  # settled: with less damping it might not stay so
        if along < _BACK_AND_FORTH * lengths:
            self.factor = min(4.0 * self.factor, _LARGEST)
        elif along > 0.0:
            self.factor = max(0.97 * self.factor, 1.0)
