"""Bounds of one step that follow from the limits of the cables, and clamping of commands.

A taut cable has the displacement of its path, u = delta; a slack one is longer than its path, u <= delta. Within a step of
length h a winch reaches u_previous +- h rate. Paying out needs delta >= u_previous - h rate; otherwise the cable would be taut
against the programme's solution. Pulling in needs no such bound: if the path shortens faster than the winch can follow, the
cable merely becomes slack, so that bound is never tighter than the present path. Thus the rates always allow the present
tensions.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.description import Limits

_RATE_MARGIN, _TENSION_MARGIN, _TRAVEL_MARGIN = 2.5e-3, 2e-4, 2e-5  # below a limit, where it counts as met: shares of its range


class StepBounds(NamedTuple):
    """Bounds of one step, all (m,): of the path's displacement in m and of the tension in N."""

    displacement_lower: np.ndarray
    displacement_upper: np.ndarray
    tension_lower: np.ndarray
    tension_upper: np.ndarray


@njit(cache=True)
def step_bounds(
    displacement: np.ndarray, tension: np.ndarray, path: np.ndarray, reach: float, farthest_out: float, farthest_in: float,
    lowest: np.ndarray, highest: float, change: float,
) -> StepBounds:  # fmt: skip
    """Return the bounds of the next step.

    displacement (m,): last command in m; tension (m,) and path (m,): tension in N and path displacement in m of the present
    state; reach in m and change in N: largest changes in a step; farthest_out and farthest_in in m, lowest (m,) and highest in
    N: the limits.
    """
    held = np.minimum(np.maximum(tension, lowest), highest)
    return StepBounds(
        np.maximum(farthest_out, displacement - reach),
        np.minimum(farthest_in, np.maximum(displacement + reach, path)),
        np.maximum(lowest, held - change),
        np.minimum(highest, held + change),
    )


@njit(cache=True)
def tip_over_cable(compliance_ea: np.ndarray, compliance_aa: np.ndarray) -> float:
    """Return the largest motion of the tip over that of the cable which moves it, from the compliances (e, m) and (m, m)."""
    largest = 0.0
    for k in range(compliance_aa.shape[0]):
        if not compliance_aa[k, k] > 0.0:
            continue
        moved = math.sqrt(compliance_ea[0, k] ** 2 + compliance_ea[1, k] ** 2 + compliance_ea[2, k] ** 2)
        largest = max(largest, moved / compliance_aa[k, k])
    return largest


def within_limits(displacement: np.ndarray, previous: np.ndarray, limits: Limits, interval: float) -> np.ndarray:
    """Return the displacement (m,) clamped to its limits and to what the winches reach from `previous` in `interval` s."""
    return held_within(
        displacement, previous, limits.displacement_rate * interval, limits.displacement_min, limits.displacement_max
    )


@njit(cache=True)
def held_within(
    displacement: np.ndarray, previous: np.ndarray, reach: float, farthest_out: float, farthest_in: float
) -> np.ndarray:
    """Compiled `within_limits`; reach: largest change in a step in m."""
    reachable = np.minimum(np.maximum(displacement, previous - reach), previous + reach)
    return np.minimum(np.maximum(reachable, farthest_out), farthest_in)


@njit(cache=True)
def limits_met(
    displacement: np.ndarray, previous: np.ndarray, reach: float, farthest_out: float, farthest_in: float, tension: np.ndarray,
    highest: float,
) -> tuple[np.ndarray, np.bool_]:  # fmt: skip
    """Return (3, m) which cables are at their limit of rate, of tension and of displacement; and whether any is.

    The margins are shares of what the limits allow, below the resolution of winches.
    """
    met = np.empty((3, len(tension)), dtype=np.bool_)
    met[0] = np.abs(displacement - previous) > (1.0 - _RATE_MARGIN) * reach
    met[1] = tension > (1.0 - _TENSION_MARGIN) * highest
    margin = _TRAVEL_MARGIN * (farthest_in - farthest_out)
    met[2] = (displacement > farthest_in - margin) | (displacement < farthest_out + margin)
    return met, met.any()
