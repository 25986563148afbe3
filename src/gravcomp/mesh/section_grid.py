"""Division of cross-sections into quadrilaterals, the same from base to tip.

The cells lie in rings around the axis, and in a core in a solid body.
The core is a square of c x c cells; 4 c cells lie around it in every ring (an O-grid), so that no cell becomes a wedge at
the axis. All nodes of a cell, its middle included, are named on half steps: (ring, angle) in the rings and (u, v) in the core.
"""

import dataclasses
import math

import numpy as np

from gravcomp.description import Outline
from gravcomp.mesh.levels import Curve, Levels
from gravcomp.mesh.measured_outline import MeasuredOutline
from gravcomp.mesh.mesh import MeshError

# Above this ratio of radii the rings of a wall are divided evenly, below it in geometric progression.
EVEN = 0.4
# How far the sides of the core bulge: 0 is a square, 1 a circle. The angles at its corners become equal in all three cells.
BULGE = 0.35


@dataclasses.dataclass(frozen=True)
class SectionGrid:
    """The cells of every section, and where their nodes lie.

    cells (k, 3, 3): numbers of the nodes of each cell; present (pieces, k): whether a piece has the cell; place (planes, n, 2):
    where the nodes lie in each plane between the pieces, in m, NaN where no piece reaches.
    """

    cells: np.ndarray
    present: np.ndarray
    place: np.ndarray


def section_grid(levels: Levels, around: int, radial: int, equal_stiffness: bool = False) -> SectionGrid:
    """Divide the sections between the levels: `around` cells about the axis, `radial` between two levels.

    equal_stiffness: the facets of a round wall, which are parabolas, are moved out until their section has the wall's second
    moment of area.

    Raises MeshError where `around` is no multiple of 4 and has to be.
    """
    curves = [outline for row in levels.curves for outline in row if outline is not None]
    cornered = levels.solid or any(outline.shape != "ellipse" for outline in curves)
    if cornered and around % 4:
        nearest = 4 * max(1, round(around / 4))
        raise MeshError(
            f"elements.around is {around}; a solid or rectangular section needs a multiple of 4: use {nearest} or {nearest + 4}"
        )
    angle = np.pi * np.arange(2 * around) / around + (math.pi / 4 if cornered else 0.0)
    if equal_stiffness:
        levels = Levels([[outline and _stood_out(outline, angle) for outline in row] for row in levels.curves], levels.spans)
    planes = [_curves_in_plane(levels, plane, angle, radial, around) for plane in range(len(levels.curves[0]))]
    boundary = np.array(planes)  # (planes, rings + 1, 2 around, 2)
    rings = boundary.shape[1] - 1
    half = np.empty((len(boundary), 2 * rings + 1, 2 * around, 2))
    half[:, ::2], half[:, 1::2] = boundary, (boundary[:, 1:] + boundary[:, :-1]) / 2
    first = 0 if levels.solid else 1
    interval = np.repeat(np.arange(first, len(levels.curves)), radial)
    ring, sector = (index.ravel() for index in np.meshgrid(np.arange(rings), np.arange(around), indexing="ij"))
    a, b = np.meshgrid(np.arange(3), np.arange(3), indexing="ij")
    cells = (2 * ring[:, None, None] + a) * 2 * around + (2 * sector[:, None, None] + b) % (2 * around)
    place = half.reshape(len(half), -1, 2)
    if not levels.solid:
        return SectionGrid(cells, _present(levels, interval[ring]), place)
    inner_cells, inner_place = core_cells(around // 4, half[:, 0], place.shape[1])
    return SectionGrid(
        np.concatenate([cells, inner_cells]),
        _present(levels, np.concatenate([interval[ring], np.zeros(len(inner_cells), dtype=interval.dtype)])),
        np.concatenate([place, inner_place], axis=1),
    )


def _present(levels: Levels, interval: np.ndarray) -> np.ndarray:
    """(pieces, k): which cells each piece has, from the level (k,) at the outer side of each."""
    low, high = np.array(levels.spans).T[:, :, None]
    return (interval > low) & (interval <= high)


def _stood_out(outline: Curve, angle: np.ndarray) -> Curve:
    """A curve so much larger that its facets, with nodes at the parameters `angle`, enclose its second moment of area."""
    if isinstance(outline, MeasuredOutline):
        return outline.stood_out(angle)
    if not isinstance(outline, Outline) or outline.shape != "ellipse":
        return outline
    h = 2.0 * math.pi / len(angle)
    t, weight = np.polynomial.legendre.leggauss(8)
    # The parabola through the points of the unit circle at -h, 0 and h, and the polar moment of area of its sector.
    x, y = 1.0 + (math.cos(h) - 1.0) * t**2, math.sin(h) * t
    dx, dy = 2.0 * (math.cos(h) - 1.0) * t, math.sin(h)
    polar = float(weight @ ((x**2 + y**2) * (x * dy - y * dx))) / 4.0
    factor = (2.0 * h / 4.0 / polar) ** 0.25
    return dataclasses.replace(outline, half_width=factor * outline.half_width, half_height=factor * outline.half_height)


def _curves_in_plane(levels: Levels, plane: int, angle: np.ndarray, radial: int, around: int) -> np.ndarray:
    """(rings + 1, angles, 2): the boundaries of the rings in a plane, from the innermost out."""
    nothing = np.full((len(angle), 2), np.nan)
    outlines = [row[plane] for row in levels.curves]
    curves = [outline.boundary(angle) if outline else nothing for outline in outlines]
    boundaries = []
    if levels.solid:
        core = _core_boundary(outlines[0], angle, around // 4, radial) if outlines[0] else nothing
        boundaries += [core + k / radial * (curves[0] - core) for k in range(radial)]
    for level in range(len(curves) - 1):
        shares = _shares(levels, level, plane, radial)
        # The level itself is known where the next one may not be.
        boundaries += [curves[level], *(curves[level] + share * (curves[level + 1] - curves[level]) for share in shares[1:])]
    return np.array([*boundaries, curves[-1]])


def _shares(levels: Levels, level: int, plane: int, radial: int) -> np.ndarray:
    """(radial,) parts of the way from a level to the next one at which rings begin."""
    pairs = [(a, b) for a, b in zip(levels.curves[level], levels.curves[level + 1]) if a and b]
    steepest = min((a.half_width / b.half_width for a, b in pairs), default=1.0)
    even = np.arange(radial) / radial
    inner, outer = levels.curves[level][plane], levels.curves[level + 1][plane]
    if steepest > EVEN or not inner or not outer:
        return even
    ratio = outer.half_width / inner.half_width
    return (ratio**even - 1.0) / (ratio - 1.0)


def _core_boundary(outline: Curve, angle: np.ndarray, across: int, radial: int) -> np.ndarray:
    """Return the sides (angles, 2) of the core, inside the innermost level; its cells are about as wide as those around it."""
    part = across / (across + radial)
    middle = np.array([outline.x, outline.y])
    if isinstance(outline, MeasuredOutline):
        square = outline.square(angle)
    else:
        shrunk = 1.0 if outline.shape == "rectangle" else math.sqrt(0.5)
        square = Outline("rectangle", shrunk * outline.half_width, shrunk * outline.half_height).boundary(angle)
    curve = outline.boundary(angle) - middle
    return middle + part * ((1.0 - BULGE) * square + BULGE * curve)


def core_cells(across: int, side: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells (c c, 3, 3) of a core, and the places (planes, m, 2) of its inner nodes, which are numbered from `first`.

    side (planes, 8 c, 2): the nodes on its sides, from the corner (1, 1) counterclockwise.
    """
    n = 2 * across
    number = np.empty((n + 1, n + 1), dtype=np.int64)
    inner = np.arange(1, n)
    number[1:-1, 1:-1] = first + np.arange(len(inner) ** 2).reshape(len(inner), -1)
    along = np.arange(n)
    number[n - along, n] = along  # top side, leftward
    number[0, n - along] = n + along
    number[along, 0] = 2 * n + along
    number[n, along] = 3 * n + along
    grid = np.full((len(side), n + 1, n + 1, 2), np.nan)
    on_side = number < first
    grid[:, on_side] = side[:, number[on_side]]
    u = (np.arange(n + 1) / n)[None, :, None, None]
    v = u.transpose(0, 2, 1, 3)
    left, right, bottom, top = grid[:, :1], grid[:, -1:], grid[:, :, :1], grid[:, :, -1:]
    corners = (
        (1 - u) * (1 - v) * grid[:, :1, :1]
        + u * (1 - v) * grid[:, -1:, :1]
        + (1 - u) * v * grid[:, :1, -1:]
        + u * v * grid[:, -1:, -1:]
    )
    filled = (1 - u) * left + u * right + (1 - v) * bottom + v * top - corners
    i, j = (index.ravel() for index in np.meshgrid(np.arange(across), np.arange(across), indexing="ij"))
    a, b = np.meshgrid(np.arange(3), np.arange(3), indexing="ij")
    cells = number[2 * i[:, None, None] + a, 2 * j[:, None, None] + b]
    return cells, filled[:, 1:-1, 1:-1].reshape(len(side), -1, 2)
