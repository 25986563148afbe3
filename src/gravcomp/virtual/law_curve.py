"""How the stiffness of a material's law changes with the strain of a filament: what the rod takes from the described law.

A filament along the robot is a bar that may contract across. Its force over its area at rest is, with the strain e = l - 1,

    P(e) = E (e + c e^2 + d e^3 + ...)

    St. Venant-Kirchhoff             P = E l (l^2 - 1) / 2                           c = 3/2, d = 1/2
    neo-Hookean, incompressible      P = E/3 (l - l^-2)                              c = -1,  d = 4/3
    Mooney-Rivlin, incompressible    P = 2 (c10 + c01 / l) (l - l^-2)                c = -1 - c01 / (c10 + c01)
    Yeoh, incompressible             P = 2 (c10 + 2 c20 (I1 - 3) + ...) (l - l^-2)   c = -1,  d = 4/3 + 6 c20 / c10

because I1 - 3 = 3 e^2 + ... (L. R. G. Treloar, The Physics of Rubber Elasticity, 1975). For any Poisson's ratio, and with fibres,
whose stress is added, c and d are found from the law itself; E is then that along the axis.

St. Venant-Kirchhoff's law folds in strong compression, which no material does. The slope of P stays where it has fallen to a
quarter of E.

Of a section the filaments are its centroid and eight points on an ellipse about it, which have its area and its second moments.
With a^2 = 2.4 in the radii a rho (rho: radii of gyration) the fourth moments are exact for rectangles, to 2 % for tubes with a
lumen of 0.4 times their diameter, to 11 % for solid circles and to 20 % for thin tubes; they enter only with d.
"""

import functools
import math

import numpy as np

from gravcomp.description import Material
from gravcomp.materials.fibres import add_fibre_stress
from gravcomp.materials.laws import LAWS, stress

_STEP = 0.02  # strain of the difference quotients
_RADIUS = 2.4  # a^2
_POINTS = 8
_LEAST_SLOPE = 0.25  # of Young's modulus
_ROUNDS = 20  # of Newton's method; it takes five


def curve_of_law(material: Material) -> tuple[float, float, float]:
    """Return c, d, and the strain in compression from which on the slope stays; see the module's text."""
    own = tuple(getattr(material, name) for name in LAWS[material.law].own_constants)
    fibres = material.fibres
    wound = (0.0, 0.0) if fibres is None else (fibres.ratio, fibres.angle)
    return _curve(material.law, material.poissons_ratio, own, wound, material.axial_modulus / material.youngs_modulus)


def filaments(axial: np.ndarray) -> np.ndarray:
    """Return the filaments (9, 3) of a section: y and -x in m, and E times area in N.

    axial (3, 3): its stiffness in stretch and the two curvatures, E int (1, y, -x)^T (1, y, -x) dA.
    """
    middle = axial[0, 1:] / axial[0, 0]
    square, across = np.linalg.eigh(axial[1:, 1:] / axial[0, 0] - np.outer(middle, middle))
    angle = 2.0 * math.pi * np.arange(_POINTS) / _POINTS
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) * np.sqrt(_RADIUS * np.maximum(square, 0.0)) @ across.T
    share = np.append(np.full(_POINTS, 2.0 / _RADIUS / _POINTS), 1.0 - 2.0 / _RADIUS)
    return np.column_stack([np.vstack([ring, np.zeros(2)]) + middle, axial[0, 0] * share])


@functools.lru_cache(maxsize=64)
def _curve(law: str, nu: float, own: tuple[float, ...], wound: tuple[float, float], along: float) -> tuple[float, float, float]:
    """See `curve_of_law`. wound: ratio of the fibres, and their angle (rad); along: modulus along the axis over Young's."""
    constants = np.array([nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu)), *own])  # of Young's modulus 1
    ratio, angle = wound
    fibres = math.sqrt(ratio) * np.array([[0.0, math.sin(angle) ** 2, math.cos(angle) ** 2, 0.0, 0.0, 0.0]])
    longer, shorter = (_force(LAWS[law].code, constants, fibres, sign * _STEP) / along for sign in (1.0, -1.0))
    c, d = (longer + shorter) / (2.0 * _STEP**2), ((longer - shorter) / 2.0 - _STEP) / _STEP**3
    compressed = -np.arange(0.0, 1.0, 0.001)
    folding = np.flatnonzero(1.0 + 2.0 * c * compressed + 3.0 * d * compressed**2 < _LEAST_SLOPE)
    return c, d, float(compressed[folding[0]]) if len(folding) else -1.0


def _force(law: int, constants: np.ndarray, fibres: np.ndarray, strain: float) -> float:
    """P over Young's modulus at the strain e of a bar with nothing on its sides; fibres (f, 6): see `materials.fibres`.

    The directions are across the wall, around and along the axis. Newton's method for the two contractions.
    """
    green, s, d = np.zeros(6), np.empty(6), np.empty((6, 6))
    green[2] = strain + 0.5 * strain**2
    for _ in range(_ROUNDS):
        stress(law, constants, green, s, d, True)
        add_fibre_stress(fibres, green, s, d, True)
        change = np.linalg.solve(d[:2, :2], s[:2])
        green[:2] -= change
        if np.abs(change).max() < 1e-15:
            break
    return (1.0 + strain) * float(s[2])
