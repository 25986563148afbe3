"""Damping of the Gauss-Newton steps of the closed loop.

The steps overshoot back and forth if the target is far away or the robot is strongly bent, because the linear response is not
valid that far. The factor of the proximal term is multiplied by four after a step that undoes a good part of the one before,
and falls slowly while steps agree, as in the Levenberg-Marquardt method. The scalar product of successive changes of
displacement shows whether they agree: the loop has no other trial.
"""

_LARGEST = 1e4
# Of the robot's length. A smaller change is noise of the gravity direction, not an overshoot.
_SMALLEST_CHANGE = 5e-5
_BACK_AND_FORTH = -0.3


class StepDamping:
    """Factor (1 or more) of the proximal term of a robot of `length` (m), adapted from step to step."""

    def __init__(self, length: float) -> None:
        self.factor = 1.0
        self._smallest = (_SMALLEST_CHANGE * length) ** 2  # m^2

    def observe(self, along: float, lengths: float) -> None:
        """Update the factor with the changes of path displacement (m,) of the last two programmes.

        along: their scalar product; lengths: product of their lengths; both in m^2.
        """
        if lengths <= self._smallest:
            return  # settled; with less damping it could start to oscillate
        if along < _BACK_AND_FORTH * lengths:
            self.factor = min(4.0 * self.factor, _LARGEST)
        elif along > 0.0:
            self.factor = max(0.97 * self.factor, 1.0)
