"""Check that a law with given constants is stable in the range of use: no bar or sheet of it pulls less when stretched more.

An incompressible block is stretched by l along one axis; the others follow as in a bar (l, l^(-1/2)), a wide strip (l, 1, 1/l)
and a sheet stretched both ways (l, l, l^-2). The force along l is dW/dl (Ogden, Non-Linear Elastic Deformations, 1984, section
7.2); it must rise with l.
"""

import numpy as np

from gravcomp.materials import laws

RANGE_OF_USE = 0.5, 2.0
"""Smallest and largest stretch at which a law must be stable; a soft robot's body stays well within."""

_MODES = {"a bar": (-0.5, -0.5), "a strip": (0.0, -1.0), "a sheet": (1.0, -2.0)}
_POINTS = 121


def falling_force(law: str, constants: np.ndarray) -> str:
    """Return where the force falls, as words; empty if the law is stable. constants: a row of `MaterialConstants.values`."""
    stretch = np.geomspace(*RANGE_OF_USE, _POINTS)
    worst = ""
    distance = np.inf
    for mode, (second, third) in _MODES.items():
        strain = np.zeros((_POINTS, 6))
        strain[:, :3] = 0.5 * (np.column_stack([stretch, stretch**second, stretch**third]) ** 2 - 1.0)
        energy = np.array([laws.energy(laws.LAWS[law].code, constants, e) for e in strain])
        force = np.diff(energy) / np.diff(stretch)
        middle = 0.5 * (stretch[1:] + stretch[:-1])
        for at in middle[1:][np.diff(force) <= 0.0]:
            if abs(np.log(at)) < distance:
                worst, distance = f"{mode} at a stretch of {at:.2f}", abs(np.log(at))
    return worst
