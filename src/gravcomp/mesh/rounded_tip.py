"""The rounding at the tip of a body whose section is swept: where layers of elements end in it, and its last section.

A rounding shrinks to a point, or to a small flat face, which no element can have as its end: its section would have no size. So
the last layer ends with a small section from just below the tip, stretched up to the tip itself. The body keeps its length, and
its mass but for less than 1e-4; where the section is that small, it does not matter for the stiffness.
"""

import math
from collections.abc import Callable

import numpy as np

# A rounding begins where the radius of a circle of the section's area shrinks by this much per length; a taper shrinks by less.
_SLOPE = 0.3
# It takes these parts of the length, and is looked for at so many places. Shorter ones are edges with a fillet, or the end of a
# body that is bent at rest, which is not exactly across its axis.
_SHORTEST, _LONGEST, _PLACES = 1e-2, 0.4, 200
# From one end of a layer to the next the radius shrinks by this factor, so that no element is distorted too much, down to where
# what is beyond, twice as large as it is when it is stretched, is this part of the body's volume.
_SHRINK, _BEYOND = 0.75, 2e-5
# Nearer to the tip than this part of the length no section is cut: there may be none.
_TIP = 1e-5


def layers_in_rounding(area: Callable[[float], float], length: float) -> tuple[float, ...]:
    """Return the arc lengths (m) at which the rounding of a tip begins, at which layers end in it, and of its last section.

    area: of the section at an arc length, in m^2; length: of the body (m). Empty for a body whose tip is not rounded.
    """
    below, there = (math.sqrt(area((1.0 - part * _SHORTEST) * length) / math.pi) for part in (1.1, 1.0))
    if below - there < 0.1 * _SHORTEST * _SLOPE * length:
        return ()  # mostly, at the cost of two sections
    # Denser toward the tip, where the radius changes most.
    from_tip = length * (_TIP + (_LONGEST - _TIP) * np.linspace(0.0, 1.0, _PLACES) ** 2)
    areas = np.array([area(length - distance) for distance in from_tip])
    radius = np.sqrt(areas / math.pi)
    steep = np.diff(radius) > _SLOPE * np.diff(from_tip)
    if not steep[0] or steep.all():
        return ()
    begin = int(np.argmin(steep))  # the first place from the tip on at which it is not steep
    if from_tip[begin] < _SHORTEST * length:
        return ()
    volume = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(from_tip) * (areas[1:] + areas[:-1]))])
    whole = volume[-1] + (length - from_tip[-1]) * areas[-1]
    last = max(int(np.searchsorted(volume, _BEYOND * whole)), 1)
    if last >= begin:
        return ()
    count = max(1, math.ceil(math.log(radius[last] / radius[begin]) / math.log(_SHRINK)))
    wanted = radius[begin] * (radius[last] / radius[begin]) ** (np.arange(count + 1) / count)
    distance = np.interp(wanted, radius[: begin + 1], from_tip[: begin + 1])
    return tuple(float(length - value) for value in distance)


def stretched(s: float, rounding: tuple[float, ...], length: float) -> float:
    """Return the arc length (m) of the section that stands at `s` (m), where the last layer is stretched up to the tip."""
    if not rounding or s <= rounding[-2]:
        return s
    before, last = rounding[-2:]
    return before + (s - before) * (last - before) / (length - before)
