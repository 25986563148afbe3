"""Area, centroid and second moments of area of a cross-section with lumens."""

import dataclasses
from collections.abc import Iterable

import numpy as np

from gravcomp.description.blended_outline import BlendedOutline
from gravcomp.description.outline import Outline


@dataclasses.dataclass(frozen=True)
class SectionMoments:
    """area (m^2); x, y: centroid (m); yy, xx, xy: integrals of y^2, x^2 and x y about the centroid (m^4).

    A bar of Young's modulus E bends about x with E yy, and about y with E xx.
    """

    area: float
    x: float
    y: float
    yy: float
    xx: float
    xy: float


def section_moments(outline: Outline | BlendedOutline, lumens: Iterable[Outline] = ()) -> SectionMoments:
    """Return the moments of the section inside `outline` and outside the lumens."""
    parts = [(1.0, outline), *((-1.0, lumen) for lumen in lumens)]
    area = sum(sign * part.area for sign, part in parts)
    x = sum(sign * part.area * part.x for sign, part in parts) / area
    y = sum(sign * part.area * part.y for sign, part in parts) / area
    yy, xx, xy = (sum(sign * part.second_moments[i] for sign, part in parts) for i in range(3))
    return SectionMoments(area, x, y, yy - area * y * y, xx - area * x * x, xy - area * x * y)


def boundary_moments(segments: np.ndarray) -> SectionMoments:
    """Return the moments of the section whose boundary is `segments` (k, 2, 2) m, each with the body on its left.

    The area integrals are boundary integrals (Green), so that order and holes need no care. All are 0 where nothing is enclosed.
    """
    (x0, y0), (x1, y1) = segments[:, 0].T, segments[:, 1].T
    cross = x0 * y1 - x1 * y0
    area = float(0.5 * cross.sum())
    if area <= 0.0:
        return SectionMoments(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    x, y = float((cross * (x0 + x1)).sum() / (6 * area)), float((cross * (y0 + y1)).sum() / (6 * area))
    yy = float((cross * (y0 * y0 + y0 * y1 + y1 * y1)).sum() / 12)
    xx = float((cross * (x0 * x0 + x0 * x1 + x1 * x1)).sum() / 12)
    xy = float((cross * (x0 * y1 + 2 * x0 * y0 + 2 * x1 * y1 + x1 * y0)).sum() / 24)
    return SectionMoments(area, x, y, yy - area * y * y, xx - area * x * x, xy - area * x * y)
