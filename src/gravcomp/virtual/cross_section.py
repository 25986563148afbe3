"""Constants of a cross-section, and the stiffness that follows from them.

Axial force and bending follow from the moments of the area about the axis of the robot, which need not be its centroid:

    K_axial = E int (1, y, -x)^T (1, y, -x) dA    in the strains (stretch, curvature about x, curvature about y)

Shear acts at the centroid with k G A. k is Cowper's coefficient for hollow circles, with m^2 = area of the lumens / area of the
outline, and for rectangles (G. R. Cowper, "The shear coefficient in Timoshenko's beam theory", J. Appl. Mech. 33, 1966):

    k = 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2),    k = 10 (1 + nu) / (12 + 11 nu)

Torsion is G J: exact for ellipses, to 0.5 % for rectangles (W. C. Young, R. G. Budynas, "Roark's Formulas for Stress and
Strain"). A round lumen at the distance e from the middle takes away 2 A e^2 + A^2 / (2 pi): exact on the axis, and elsewhere for
a lumen that is small against the outline, because a round hole doubles the shear next to it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gravcomp.description import BlendedOutline, Material, Outline
from gravcomp.description.section_moments import boundary_moments


@dataclass(frozen=True)
class CrossSection:
    """Constants of a cross-section, about the axis of the robot.

    second: integrals of y^2, x^2 and x y; torsion: J about the centroid; half_width, half_height: of the outline, along x and y.
    """

    area: float  # m^2
    first: tuple[float, float]  # m^3, integrals of x and y
    second: tuple[float, float, float]  # m^4
    torsion: float  # m^4
    hollow: float  # m^2 of Cowper's coefficient
    round: bool  # whether Cowper's coefficient is that of a hollow circle; else that of a rectangle
    half_width: float  # m
    half_height: float  # m

    @property
    def centroid(self) -> tuple[float, float]:
        """Centre (x, y) of the area, m."""
        return self.first[0] / self.area, self.first[1] / self.area

    def stiffness(self, material: Material) -> np.ndarray:
        """Return the stiffness (6, 6) of the strains of rod.py: N, N m and N m^2.

        Shear has the modulus by which the body twists: in the wall of a tube it acts along and around the axis.
        """
        (x, y), (yy, xx, xy) = self.first, self.second
        axial = material.axial_modulus * np.array([[self.area, y, -x], [y, yy, -xy], [-x, -xy, xx]])
        shear = material.shear_modulus
        cx, cy = self.centroid
        at_centroid = np.array([[1.0, 0.0, -cy], [0.0, 1.0, cx]])
        across = self._shear_coefficient(material.poissons_ratio) * shear * self.area
        stiffness = np.zeros((6, 6))
        stiffness[np.ix_((2, 3, 4), (2, 3, 4))] = axial
        stiffness[np.ix_((0, 1, 5), (0, 1, 5))] = across * at_centroid.T @ at_centroid
        stiffness[5, 5] += shear * self.torsion
        return stiffness

    def inertia(self, density: float) -> np.ndarray:
        """Return the moments of inertia (3, 3) per length about the axis, kg m."""
        yy, xx, xy = self.second
        return density * np.array([[yy, -xy, 0.0], [-xy, xx, 0.0], [0.0, 0.0, xx + yy]])

    def _shear_coefficient(self, nu: float) -> float:
        if not self.round:
            return 10 * (1 + nu) / (12 + 11 * nu)
        m2 = self.hollow
        return 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)


def cross_section(outline: Outline | BlendedOutline, lumens: Sequence[Outline]) -> CrossSection:
    """Return the constants of an outline with lumens."""
    parts = [(1.0, outline), *((-1.0, lumen) for lumen in lumens)]
    area = sum(sign * part.area for sign, part in parts)
    first = sum(sign * part.area * part.x for sign, part in parts), sum(sign * part.area * part.y for sign, part in parts)
    yy, xx, xy = (sum(sign * part.second_moments[i] for sign, part in parts) for i in range(3))
    whole = _torsion(outline) if isinstance(outline, Outline) else _torsion_by_moments(area, first, (yy, xx, xy))
    torsion = whole
    for lumen in lumens:
        away = (lumen.x - outline.x) ** 2 + (lumen.y - outline.y) ** 2
        torsion -= 2 * lumen.area * away + _torsion(lumen)
    hollow = sum(lumen.area for lumen in lumens) / outline.area
    return CrossSection(
        area, first, (yy, xx, xy), max(torsion, 0.05 * whole), hollow, outline.shape == "ellipse",
        outline.half_width, outline.half_height,
    )  # fmt: skip


def sliced_section(segments: np.ndarray) -> CrossSection | None:
    """Return the constants of the section whose boundary is `segments` (k, 2, 2) m, each with the body on its left; None: empty.

    J is 4 I_1 I_2 / (I_1 + I_2) with the principal moments, exact for ellipses and tubes, and up to 19 % too large for others.
    """
    moments = boundary_moments(segments)
    area, x, y = moments.area, moments.x, moments.y
    if area <= 0.0:
        return None
    first, second = (area * x, area * y), (moments.yy + area * y * y, moments.xx + area * x * x, moments.xy + area * x * y)
    half_width, half_height = 0.5 * np.ptp(segments.reshape(-1, 2), axis=0)
    hollow = min(max(1.0 - area / (math.pi * half_width * half_height), 0.0), 1.0)
    return CrossSection(
        area, first, second, _torsion_by_moments(area, first, second), hollow, True, float(half_width), float(half_height)
    )


def _torsion_by_moments(area: float, first: tuple[float, float], second: tuple[float, float, float]) -> float:
    (yy, xx, xy), cx, cy = second, first[0] / area, first[1] / area
    i1, i2 = np.linalg.eigvalsh([[yy - area * cy**2, xy - area * cx * cy], [xy - area * cx * cy, xx - area * cx**2]])
    return float(4 * i1 * i2 / (i1 + i2))


def _torsion(outline: Outline) -> float:
    """J (m^4) of a solid ellipse or rectangle about its middle."""
    a, b = max(outline.half_width, outline.half_height), min(outline.half_width, outline.half_height)
    if outline.shape == "ellipse":
        return math.pi * a**3 * b**3 / (a**2 + b**2)
    return a * b**3 * (16 / 3 - 3.36 * b / a * (1 - b**4 / (12 * a**4)))
