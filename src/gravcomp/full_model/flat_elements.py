"""Grading of the layers toward the clamp, without elements that are flat, and walls without cells that are deep.

Hexahedra with reduced integration have modes without strain energy at their points of integration. One layer of flat elements
across a wall nearly follows them: measured on a tube of 30/8 mm, the tip sags by 7 % too far with 28 layers whose first is 0.1 of
the wall thick, and is right from 0.4 on. Cells that are deep through the wall follow them too: bent, the tip of the same tube
moves by 0.2 % of the length from cells 1.1 x as deep as wide to 1.5 x, and by 5 % to 2.2 x as deep. Cells of 1.4 x are right.
"""

import dataclasses
import math

from gravcomp.description import Elements, Robot
from gravcomp.mesh.division import pieces_to_divide, walls
from gravcomp.mesh.layers import layers_of

_STRONGEST = 8.0
_FLATTEST = 0.45
_DEEPEST = 1.4
# A body is slender if the first of so many layers is thicker with the strongest grading than it has to be for a coarse section.
_SLENDER, _COARSE = 24, Elements(around=6, along=10, radial=1)


def with_grading(robot: Robot, elements: Elements) -> Elements:
    """Return the elements with the strongest grading up to 8 whose first layer is at least 0.45 x as thick as it is wide.

    A slender body gets a first layer as thick as that, as its layers stay thicker whatever their grading.
    """
    thinnest = _FLATTEST * _width(robot, elements)
    if _first(robot, dataclasses.replace(elements, along=_SLENDER), _STRONGEST) > _FLATTEST * _width(robot, _COARSE):
        return dataclasses.replace(elements, grading=1.0, first_layer=float(f"{thinnest:.3g}"))
    low, high = 1.0, _STRONGEST
    if _first(robot, elements, high) >= thinnest:
        return dataclasses.replace(elements, grading=high)
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _first(robot, elements, middle) >= thinnest else (low, middle)
    return dataclasses.replace(elements, grading=round(low, 2))


def _width(robot: Robot, elements: Elements) -> float:
    """Smallest width (m) of the elements across the base's section."""
    half, lumens = walls(robot)[0]
    if not lumens:
        return 2.0 * half / (elements.around / 4 + 2 * elements.radial)
    inner = lumens[0]
    return min((half - inner) / elements.radial, math.pi * (half + inner) / elements.around)


def deep_cells(robot: Robot, elements: Elements) -> bool:
    """Return whether cells through the wall around a single lumen are more than 1.4 x as deep as wide."""
    for half, lumens in walls(robot):
        if len(lumens) != 1:
            continue
        inner = lumens[0]
        if (half - inner) / elements.radial > _DEEPEST * math.pi * (half + inner) / elements.around:
            return True
    return False


def _first(robot: Robot, elements: Elements, grading: float) -> float:
    """Thickness (m) of the first of the layers."""
    return float(layers_of(pieces_to_divide(robot), elements.along, grading, softness=elements.softness)[0][1])
