"""Scaling of a step's programme for the solver, and of its solution back.

Tensions are scaled so that the Hessian has a unit diagonal, displacements so that the rows have unit length; the cost is in
square millimetres.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.inverse.limits import StepBounds

NO_BOUND = 1e20
"""Value that ProxQP takes as no bound."""

# N. Tensions are rounded to this: ProxQP's last bits depend on the address of its memory, and a run must be repeatable.
_QUANTUM = 2.0**-30


class Couplings(NamedTuple):
    """Bounds of q sums of path displacements, least <= rows . displacement <= most; rows (q, m), least and most (q,) in m."""

    rows: np.ndarray
    least: np.ndarray
    most: np.ndarray


UNCOUPLED = Couplings(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
"""Every cable has a motor of its own."""


class TensionRows(NamedTuple):
    """Bounds of p sums of tensions, least <= rows . tension <= most; a row (p, m) of zeros is no bound."""

    rows: np.ndarray
    least: np.ndarray
    most: np.ndarray


NO_ROWS = TensionRows(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
"""Nothing around the robot bounds its tensions."""


class Programme(NamedTuple):
    """min 1/2 x^T hessian x + gradient^T x  s.t.  the bounds; x (m,): tensions in N; displacement = compliance x + offset."""

    hessian: np.ndarray
    gradient: np.ndarray
    compliance: np.ndarray
    offset: np.ndarray
    bounds: StepBounds
    couplings: Couplings = UNCOUPLED
    around: TensionRows = NO_ROWS


class ScaledProgramme(NamedTuple):
    """min 1/2 y^T hessian y + gradient^T y  s.t.  lower <= rows y <= upper, box_lower <= y <= box_upper; tension = scale y.

    rows: of the displacements, of the couplings, and, from `first_around` on, of what is around the robot; tension_lower and
    tension_upper (m,): bounds of the tension in N; trace: a sum that is finite only if all numbers of the
    programme are.
    """

    hessian: np.ndarray
    gradient: np.ndarray
    rows: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    box_lower: np.ndarray
    box_upper: np.ndarray
    scale: np.ndarray
    tension_lower: np.ndarray
    tension_upper: np.ndarray
    trace: float
    first_around: int


@njit(cache=True)
def scaled(programme: Programme) -> ScaledProgramme:
    """Return the programme in the solver's units."""
    hessian, gradient, compliance, offset, bounds, couplings, around = programme
    m, q, p = len(gradient), len(couplings.least), len(around.least)
    to_hessian, to_gradient, rows = np.empty((m, m)), np.empty(m), np.zeros((m + q + p, m))
    lower, upper, box_lower, box_upper = np.empty(m + q + p), np.empty(m + q + p), np.empty(m), np.empty(m)
    # Millimetres make the cost of order one.
    scale = 1e-3 / np.sqrt(0.5 * np.diag(hessian))
    for i in range(m):
        to_gradient[i] = 0.5e6 * gradient[i] * scale[i]
        box_lower[i], box_upper[i] = bounds.tension_lower[i] / scale[i], min(bounds.tension_upper[i] / scale[i], NO_BOUND)
        length = 0.0
        for k in range(m):
            to_hessian[i, k] = 0.5e6 * hessian[i, k] * scale[i] * scale[k]
            rows[i, k] = compliance[i, k] * scale[k]
            length += rows[i, k] ** 2
        row = 1.0 / np.sqrt(length)
        for k in range(m):
            rows[i, k] *= row
        lower[i] = max((bounds.displacement_lower[i] - offset[i]) * row, -NO_BOUND)
        upper[i] = min((bounds.displacement_upper[i] - offset[i]) * row, NO_BOUND)
    for c in range(q):
        length, present = 0.0, 0.0
        for i in range(m):
            present += couplings.rows[c, i] * offset[i]
            for k in range(m):
                rows[m + c, k] += couplings.rows[c, i] * compliance[i, k] * scale[k]
        for k in range(m):
            length += rows[m + c, k] ** 2
        row = 1.0 / np.sqrt(length)
        for k in range(m):
            rows[m + c, k] *= row
        lower[m + c] = max((couplings.least[c] - present) * row, -NO_BOUND)
        upper[m + c] = min((couplings.most[c] - present) * row, NO_BOUND)
    for c in range(m + q, m + q + p):
        length = 0.0
        for k in range(m):
            rows[c, k] = around.rows[c - m - q, k] * scale[k]
            length += rows[c, k] ** 2
        row = 1.0 / np.sqrt(length) if length > 0.0 else 0.0
        for k in range(m):
            rows[c, k] *= row
        lower[c] = max(around.least[c - m - q] * row, -NO_BOUND) if row > 0.0 else -NO_BOUND
        upper[c] = min(around.most[c - m - q] * row, NO_BOUND) if row > 0.0 else NO_BOUND
    trace = around.rows.sum() + hessian.sum() + gradient.sum() + offset.sum() + compliance.sum()
    return ScaledProgramme(
        to_hessian,
        to_gradient,
        rows,
        lower,
        upper,
        box_lower,
        box_upper,
        scale,
        bounds.tension_lower,
        bounds.tension_upper,
        trace,
        m + q,
    )


@njit(cache=True)
def unscaled(
    unknowns: np.ndarray, multipliers: np.ndarray, scale: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tensions (m,) in N within their bounds, and the unwanted tensions (m,) in N, both rounded to `_QUANTUM`.

    Unwanted is the distance by which the programme would go below 0 if cables could push. It is 0 where no bound is active, and
    at a bound above 0: such a cable stays taut. unknowns: m scaled tensions first; multipliers: of the rows, then of the box,
    which has one for each unknown.
    """
    m, box = len(scale), len(multipliers) - len(unknowns)
    tension, unwanted = np.empty(m), np.empty(m)
    for i in range(m):
        tension[i] = min(max(np.rint(unknowns[i] * scale[i] / _QUANTUM) * _QUANTUM, lower[i]), upper[i])
        # The Hessian's diagonal is 1, so a multiplier is also the step beyond its bound.
        below = max(0.0, -multipliers[box + i]) if lower[i] <= 0.0 else 0.0
        unwanted[i] = np.rint(below * scale[i] / _QUANTUM) * _QUANTUM
    return tension, unwanted
