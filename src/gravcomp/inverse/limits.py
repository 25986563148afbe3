"""What is left of the cables' limits for one step.

A taut cable has the displacement of its path, u = delta; a slack one is longer than its path, u <= delta. Within a step
of length h a winch reaches u_previous +- h rate. Paying out is the hard side: delta >= u_previous - h rate, or the
cable would be taut against the will of the programme. Pulling in is not: a cable whose path has become shorter than the
winch can follow merely stays slack, so that side is never tighter than the path is now. With that the present tensions
are always allowed by the rates.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.description import Limits


class StepBounds(NamedTuple):
    """The bounds of one step, all (m,): of the path's displacement (m) and of the tension (N)."""

    displacement_lower: np.ndarray
    displacement_upper: np.ndarray
    tension_lower: np.ndarray
    tension_upper: np.ndarray


@njit(cache=True)
def step_bounds(displacement, tension, path, reach, farthest_out, farthest_in, lowest, highest, change) -> StepBounds:
    """What is left of the limits for the next step.

    displacement (m,): commanded last; tension (m,) and path (m,): tension and path displacement of the present state; reach (m)
    and change (N): the longest ways of a step; farthest_out, farthest_in (m), lowest, highest (N): the limits themselves.
    """
    held = np.minimum(np.maximum(tension, lowest), highest)
    return StepBounds(
        np.maximum(farthest_out, displacement - reach),
        np.minimum(farthest_in, np.maximum(displacement + reach, path)),
        np.maximum(lowest, held - change),
        np.minimum(highest, held + change),
    )


def within_limits(displacement: np.ndarray, previous: np.ndarray, limits: Limits, interval: float) -> np.ndarray:
    """The displacement (m,) held to its bounds and to what the winches reach from the previous one in the interval (s)."""
    return held_within(
        displacement, previous, limits.displacement_rate * interval, limits.displacement_min, limits.displacement_max
    )


@njit(cache=True)
def held_within(displacement, previous, reach, farthest_out, farthest_in):
    """As `within_limits`; reach (m): the longest way of a step."""
    reachable = np.minimum(np.maximum(displacement, previous - reach), previous + reach)
    return np.minimum(np.maximum(reachable, farthest_out), farthest_in)


@njit(cache=True)
def limits_met(displacement, previous, reach, farthest_out, farthest_in, tension, highest):
    """(3, m): which cables move as fast as they may, have the highest tension, are at an end of their travel; and whether any is.

    A micrometre and a millinewton are below what any winch resolves.
    """
    met = np.empty((3, len(tension)), dtype=np.bool_)
    met[0] = np.abs(displacement - previous) > reach - 1e-6
    met[1] = tension > highest - 1e-3
    met[2] = (displacement > farthest_in - 1e-6) | (displacement < farthest_out + 1e-6)
    return met, met.any()
