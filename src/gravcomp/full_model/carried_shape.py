"""A deformed shape on one mesh of a robot, carried to another mesh of the same robot.

By sections: in every cross-section between two layers the displacements are fitted by polynomials of second degree in the place
in the section, which contain its motion as a rigid body, its bending and its contraction across. Their coefficients are
interpolated along the robot. It takes little time, and suits robots of segments. By elements: nodes move with the elements in
which they lie. That suits every body, and shapes bent so far that sections warp: of an arm that its weight bends by more than a
right angle, Newton's method finds no equilibrium from the first, and needs four steps from the second. Neither result is an
equilibrium.
"""

import numpy as np

from gravcomp.mesh import Mesh
from gravcomp.mesh.embedding import embed

_DEGREE = 2
# Nodes of a section may be too few for all terms: those that they do not determine are left out.
_UNDETERMINED = 1e-9


def carried_shape(u: np.ndarray, source: Mesh, target: Mesh, *, by_elements: bool) -> np.ndarray:
    """Return displacements (n, 3) in m of the target mesh, from those of the source (m, 3). Both are of the same body.

    by_elements: the way; by sections only where the source consists of layers.

    Raises MeshError, by elements, if a node of the target lies outside the other mesh.
    """
    from scipy.interpolate import CubicSpline

    if by_elements:
        place = embed(source, target.nodes)
        moved: np.ndarray = np.einsum("nc,nci->ni", place.weights, u[place.nodes])
        moved[target.clamped] = 0.0
        return moved

    here, there = source.straight, target.straight
    size = float(np.abs(here[:, :2]).max())
    level = np.abs(here[:, 2, None] - source.stations).argmin(axis=1)
    heights = source.stations[::2]  # at those between them only some nodes of an element lie
    coefficients = []
    for number in range(len(heights)):
        on = level == 2 * number
        terms = _terms(here[on, :2] / size)
        coefficients.append(np.linalg.lstsq(terms, u[on], rcond=_UNDETERMINED)[0])
    along = CubicSpline(heights, np.array(coefficients))(np.clip(there[:, 2], heights[0], heights[-1]))
    shape: np.ndarray = np.einsum("nc,nci->ni", _terms(there[:, :2] / size), along)
    shape[target.clamped] = 0.0
    return shape


def _terms(place: np.ndarray) -> np.ndarray:
    """The terms (n, c) of the polynomials at places (n, 2)."""
    x, y = place.T
    return np.column_stack([x**i * y ** (k - i) for k in range(_DEGREE + 1) for i in range(k + 1)])
