"""What hinders sections from contracting across the axis, and so stiffens the rod there: its clamp, and stiffer stretches.

A bent section contracts across on its stretched side and widens on the other, by Poisson's ratio nu times the curvature
kappa = M / B (bending stiffness B). The clamped face holds it, and so does a stretch that bends less. By linear elasticity a tube
with a clamped face seems shorter by

    delta = nu^2 d,    d = 0.43 (1 + nu^2 / 2) (1 - 0.32 a - 0.27 a^2) h

h half the height of the section, a the area of the lumens over that of the outline: within 1 % for nu from 0.2 to 0.49, lumens up
to 0.8 of the diameter. An end that is to follow another contraction nu kappa resists it by K = d B. Two ends in series take up
the difference of their contractions, which lowers the angle between them by C M with

    C = K_1 K_2 / (K_1 + K_2) (1 - 0.8 K_1 K_2 / (K_1 + K_2)^2) (nu_1 / B_1 - nu_2 / B_2)^2

(the bracket: the ends also follow each other along the axis; within 3 % for moduli that differ by factors of 1.2 to 20). A clamp
is an end that does not bend at all: K_1 infinite, 1 / B_1 = 0. The constants are from finite elements of the first harmonic
of a tube under pure bending, with an outer diameter of 9 mm.
"""

import math
from collections.abc import Sequence

import numpy as np

from gravcomp.virtual.cross_section import CrossSection
from gravcomp.virtual.stretches import Stretch

_REACH = 2.5  # times the length by which a stretch seems shorter: the elements over which it is spread
_LEAST = 0.2  # of these elements' length that is left


def held_depth(section: CrossSection, half: float, nu: float) -> float:
    """Return d in m of a section that is bent across its half height `half` in m."""
    return 0.43 * (1.0 + 0.5 * nu**2) * (1.0 - 0.32 * section.hollow - 0.27 * section.hollow**2) * half


def stiffen_held_sections(stretches: Sequence[Stretch], ends: np.ndarray, stiffness: np.ndarray) -> None:
    """Stiffen the bending of the elements (n, 6, 6) next to the clamp and to stiffer stretches; ends (n + 1,): of elements, m."""
    for axis in (3, 4):
        _stiffen(ends, stiffness, axis, 0.0, stretches[0].length, _depth(stretches[0], 0.0, axis))
        for one, other in zip(stretches, stretches[1:]):
            at = other.start
            first = int(np.argmin(np.abs(ends - at)))
            if not 0 < first < len(stiffness):
                continue
            bending = stiffness[first - 1, axis, axis], stiffness[first, axis, axis]
            shift = _turned_less(bending, (one, other), at, axis)
            soft = int(np.argmin(bending))
            reach = -one.length if soft == 0 else other.length
            _stiffen(ends, stiffness, axis, at, reach, shift * bending[soft])


def _depth(stretch: Stretch, at: float, axis: int) -> float:
    """Return by how much a stretch that is held at the arc length `at` seems shorter, m."""
    nu = stretch.material.poissons_ratio
    return nu**2 * _own_depth(stretch, at, axis)


def _own_depth(stretch: Stretch, at: float, axis: int) -> float:
    section = stretch.section(min(at, stretch.start + stretch.length * (1.0 - 1e-9)))
    half = section.half_height if axis == 3 else section.half_width
    return held_depth(section, half, stretch.material.poissons_ratio)


def _turned_less(bending: tuple[float, float], pair: tuple[Stretch, Stretch], at: float, axis: int) -> float:
    """Return C in rad/(N m) between two stretches with these bending stiffnesses in N m^2."""
    own = [_own_depth(stretch, at, axis) * b for stretch, b in zip(pair, bending)]  # K
    together = own[0] * own[1] / (own[0] + own[1])
    together *= 1.0 - 0.8 * own[0] * own[1] / (own[0] + own[1]) ** 2
    contraction = [stretch.material.poissons_ratio / b for stretch, b in zip(pair, bending)]
    return float(together * (contraction[0] - contraction[1]) ** 2)


def _stiffen(ends: np.ndarray, stiffness: np.ndarray, axis: int, at: float, reach: float, shift: float) -> None:
    """Stiffen elements beyond `at` m so that they seem shorter by `shift` m; reach in m: how far they may go, below 0: back."""
    if shift <= 0.0:
        return
    wanted = math.copysign(min(_REACH * shift, abs(reach)), reach)
    low, high = sorted((at, at + wanted))
    # Every element that has part of it; neighbours that only touch it do not count.
    inside = np.flatnonzero((ends[1:] > low + 1e-9) & (ends[:-1] < high - 1e-9))
    length = float(ends[inside[-1] + 1] - ends[inside[0]])
    scale = math.sqrt(length / max(length - shift, _LEAST * length))
    stiffness[inside, axis, :] *= scale
    stiffness[inside, :, axis] *= scale
