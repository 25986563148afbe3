"""Check that a law with given constants is stable in the range of use: no bar or sheet of it pulls less when stretched more.

An incompressible block is stretched by l along one axis; the others follow as in a bar (l, l^(-1/2)), a wide strip (l, 1, 1/l)
and a sheet stretched both ways (l, l, l^-2). The force along l is dW/dl (Ogden, Non-Linear Elastic Deformations, 1984, section
7.2); it must rise with l. That of neo-Hookean and Mooney-Rivlin laws does so with every constant that is allowed, because both
invariants of a block are convex in l. That of Yeoh's law W(I1), dW/dI1 dI1/dl, need not.
"""

import numpy as np

RANGE_OF_USE = 0.5, 2.0
"""Smallest and largest stretch, in any direction, at which a law must be stable; a soft robot's body stays well within."""

_MODES = {"a bar": (-0.5, -0.5), "a strip": (0.0, -1.0), "a sheet": (1.0, -2.0)}
_POINTS = 241


def yeoh_falls(c20_ratio: float, c30_ratio: float) -> str:
    """Return where the force on a block of Yeoh's law falls, as words, the place nearest to no stretch; empty: nowhere."""
    low, high = RANGE_OF_USE
    stretch = np.geomspace(low, high, _POINTS)
    middle = 0.5 * (stretch[1:] + stretch[:-1])
    worst, distance = "", np.inf
    for mode, powers in _MODES.items():
        sides = [(p, stretch ** (2.0 * p)) for p in (1.0, *powers)]
        x = sum(square for _, square in sides) - 3.0
        within = np.all([(square >= low**2) & (square <= high**2) for _, square in sides], axis=0)
        slope = sum(2.0 * p * square for p, square in sides) / stretch  # dI1/dl
        force = (1.0 + 2.0 * c20_ratio * x + 3.0 * c30_ratio * x**2) * slope
        for at in middle[(np.diff(force) <= 0.0) & within[1:] & within[:-1]]:
            if abs(np.log(at)) < distance:
                worst, distance = f"{mode} at a stretch of {at:.2f}", abs(np.log(at))
    return worst
