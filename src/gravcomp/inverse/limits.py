"""What is left of the cables' limits for one step.

A taut cable has the displacement of its path, u = delta; a slack one is longer than its path, u <= delta. Within a step
of length h a winch reaches u_previous +- h rate. Paying out is the hard side: delta >= u_previous - h rate, or the
cable would be taut against the will of the programme. Pulling in is not: a cable whose path has become shorter than the
winch can follow merely stays slack, so that side is never tighter than the path is now. With that the present tensions
are always allowed by the rates.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from gravcomp.description.robot import Limits


@dataclass(frozen=True)
class StepBounds:
    """The bounds of one step, all (m,): of the path's displacement (m) and of the tension (N)."""

    displacement_lower: np.ndarray
    displacement_upper: np.ndarray
    tension_lower: np.ndarray
    tension_upper: np.ndarray


def step_bounds(
    limits: Limits, *, displacement: np.ndarray, tension: np.ndarray, path: np.ndarray, pretension: float, interval: float
) -> StepBounds:
    """What is left of the limits for the next `interval` (s).

    displacement (m,): commanded last; tension (m,) and path (m,): tension and path displacement of the present state;
    pretension (N): least tension asked for, where it is above the limits' own.
    """
    lowest = min(max(pretension, limits.tension_min), limits.tension_max)
    reach, change = limits.displacement_rate * interval, limits.tension_rate * interval
    travel = limits.displacement_min, limits.displacement_max
    return StepBounds(*_step_bounds(displacement, tension, path, *travel, reach, lowest, limits.tension_max, change))


@njit(cache=True)
def _step_bounds(displacement, tension, path, farthest_out, farthest_in, reach, lowest, highest, change):
    held = np.minimum(np.maximum(tension, lowest), highest)
    return (
        np.maximum(farthest_out, displacement - reach),
        np.minimum(farthest_in, np.maximum(displacement + reach, path)),
        np.maximum(lowest, held - change),
        np.minimum(highest, held + change),
    )


def within_limits(displacement: np.ndarray, previous: np.ndarray, limits: Limits, interval: float) -> np.ndarray:
    """The displacement (m,) held to its bounds and to what the winches reach from the previous one in the interval (s)."""
    return _within_limits(
        displacement, previous, limits.displacement_rate * interval, limits.displacement_min, limits.displacement_max
    )


@njit(cache=True)
def _within_limits(displacement, previous, reach, farthest_out, farthest_in):
    reachable = np.minimum(np.maximum(displacement, previous - reach), previous + reach)
    return np.minimum(np.maximum(reachable, farthest_out), farthest_in)
