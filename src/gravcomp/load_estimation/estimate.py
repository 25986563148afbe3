"""What is known of the load at the tip."""

import dataclasses

import numpy as np

_INTERVAL = 1.96  # standard deviations of an interval of 95 %


@dataclasses.dataclass(frozen=True)
class LoadEstimate:
    """The load at the tip.

    force (3,) in N in soft_base, with covariance (3, 3); mass in kg and its standard deviation, for a payload; zeroed: the
    model's errors were measured without load; sources: what was measured lately; sentence: what the user has to know, empty while
    all is well.
    """

    force: np.ndarray
    covariance: np.ndarray
    mass: float
    mass_std: float
    zeroed: bool
    sources: tuple[str, ...]
    sentence: str

    @property
    def mass_interval(self) -> tuple[float, float]:
        """The interval in kg that holds the mass in 95 of 100 cases, if the errors are as the options say."""
        return self.mass - _INTERVAL * self.mass_std, self.mass + _INTERVAL * self.mass_std
