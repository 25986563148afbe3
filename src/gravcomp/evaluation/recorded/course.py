"""Course of a recorded run: tips, gravity, targets and phases at the times of the measured tip."""

from dataclasses import dataclass

import numpy as np

RELEASED, HELD, BETWEEN = 0, 1, 2
"""Phases: cables paid out; the controller keeps a target; neither."""


@dataclass(frozen=True)
class Course:
    """t samples at the times of the measured tip. SI, soft_base."""

    time: np.ndarray  # (t,) s since the first sample
    tip_position: np.ndarray  # (t, 3)
    tip_direction: np.ndarray  # (t, 3)
    model_tip_position: np.ndarray  # (t, 3)
    gravity: np.ndarray  # (t, 3) as estimated
    phase: np.ndarray  # (t,) RELEASED, HELD or BETWEEN
    target_position: np.ndarray  # (t, 3)
    target_direction: np.ndarray  # (t, 3)

    def rows(self, which: np.ndarray | slice) -> "Course":
        """Return the samples of a mask, of indices or of a slice."""
        return Course(*(getattr(self, name)[which] for name in Course.__dataclass_fields__))


def last_known(time: np.ndarray, known: np.ndarray, values: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return (t, n): at each time (t,) the last of the values (k, n) with known (k,) <= time; before all of them `first` (n,)."""
    return np.vstack([first, values])[np.searchsorted(known, time, side="right")]
