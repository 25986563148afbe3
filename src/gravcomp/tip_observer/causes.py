"""Names the cause of measurements that cannot be of this robot: unit, axes, handedness, frame, clock."""

import itertools
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from gravcomp.inverse.target import REACH

_SINCE_BOOT = 1e8  # s, three years: a clock that counts from the start of a machine is below, one that counts from 1970 above
_AHEAD = 0.05  # s: synchronised clocks differ by less
_UNIT = 1000.0


class _Axes(NamedTuple):
    matrix: np.ndarray  # (3, 3)
    name: str


def _all_axes() -> list[_Axes]:
    """The 47 other ways to name and direct three axes, those with the fewest changes first."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if (matrix == np.eye(3)).all():
                continue
            read = ", ".join(f"{'-' if s < 0 else ''}{'xyz'[o]}" for s, o in zip(signs, order))
            kind = "mirrored (left-handed)" if np.linalg.det(matrix) < 0 else "turned"
            found.append((np.abs(matrix - np.eye(3)).sum(), _Axes(matrix, f"{kind}: it fits when read as ({read})")))
    return [axes for _, axes in sorted(found, key=lambda entry: entry[0])]


_AXES = _all_axes()


def is_since_boot(stamp: float, now: float) -> bool:
    """Return whether a stamp (s) counts from the start of a machine while the time `now` (s) does not."""
    return stamp < _SINCE_BOOT < now


def wrong_stamp(stamp: float, now: float, longest_delay: float) -> str:
    """Return what is wrong with a stamp (s) at the time `now` (s), empty for nothing."""
    if not np.isfinite(stamp):
        return f"its stamp is {stamp}"
    if stamp == 0.0:
        return "it has no stamp; set tracker.stamp to arrival, or stamp it with the time of the measurement"
    if is_since_boot(stamp, now):
        return f"its stamp {stamp:.1f} s is not the graph's time {now:.1f} s: it counts from the start of a machine?"
    if stamp > now + _AHEAD:
        return f"its stamp is {stamp - now:.2f} s ahead: the clocks are not synchronised"
    if stamp < now - longest_delay:
        return f"it is {now - stamp:.2f} s late; allowed: {longest_delay:g} s"
    return ""


def wild(measured: np.ndarray, modelled: np.ndarray, length: float, allowed: float) -> str:
    """Return what may be wrong with a tip (3,) that is farther than `allowed` from the model's (3,), all in m."""
    missed = np.linalg.norm(measured - modelled)
    found = f"the tip at ({', '.join(f'{1e3 * v:.1f}' for v in measured)}) mm is {1e3 * missed:.1f} mm from the model's"
    found += f" (allowed {1e3 * allowed:.1f} mm)"
    if np.linalg.norm(measured / _UNIT - modelled) <= allowed:
        return f"{found}: its position is in mm; m are needed"
    if np.linalg.norm(measured * _UNIT - modelled) <= allowed:
        return f"{found}: its position is 1000 times too small; m are needed"
    for axes in _AXES:
        if np.linalg.norm(axes.matrix @ measured - modelled) <= 0.5 * allowed:
            return f"{found}: its frame may be {axes.name}"
    if np.linalg.norm(measured) > REACH * length:
        return f"{found}: out of reach of a robot of {1e3 * length:.0f} mm, it is in another frame"
    return found


def wrong_axes(pairs: Iterable[tuple[np.ndarray, np.ndarray]], std: float) -> str:
    """Return in which way measured tips move in other axes than the modelled ones, empty where they do not.

    pairs: measured and modelled tip (3,) in m; std in m: of a measurement. Only changes count: a wrong origin does not matter.
    """
    moved, expected = (np.array(points) - np.mean(points, axis=0) for points in zip(*pairs))
    cost = float(((moved - expected) ** 2).sum())
    # Small motions say nothing: noise and the robot's lag would explain them.
    if cost < 12.0 * std**2 * len(moved) or (expected**2).sum() < 6.0 * std**2 * len(moved):
        return ""
    costs = [float(((moved @ axes.matrix.T - expected) ** 2).sum()) for axes in _AXES]
    best = int(np.argmin(costs))
    return f"its frame is {_AXES[best].name}" if costs[best] < 0.2 * cost else ""
