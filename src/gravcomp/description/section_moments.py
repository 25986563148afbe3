"""Area, centroid and second moments of area of a cross-section with lumens."""

import dataclasses
from collections.abc import Iterable

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
