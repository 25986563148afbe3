"""The programme of a step in the solver's units: tensions scaled to a Hessian of unit diagonal, displacements to rows of unit length,
the cost in square millimetres.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.inverse.limits import StepBounds

NO_BOUND = 1e20
"""Stands for 'none'; ProxQP takes it as infinite."""

# N. ProxQP's last bits depend on where its memory lies; to this they are rounded away, so that a run can be repeated.
_QUANTUM = 2.0**-30


class Programme(NamedTuple):
    """min 1/2 x^T hessian x + gradient^T x over the tensions x (m,), subject to the bounds, with displacement =
    compliance x + offset.
    """

    hessian: np.ndarray
    gradient: np.ndarray
    compliance: np.ndarray
    offset: np.ndarray
    bounds: StepBounds


class ScaledProgramme(NamedTuple):
    """min 1/2 y^T hessian y + gradient^T y subject to lower <= rows y <= upper and box_lower <= y <= box_upper, with tension = scale y.

    tension_lower and tension_upper (m,) N: what the box came from; trace: a sum in which a number that is not finite leaves its trace.
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


@njit(cache=True)
def scaled(programme: Programme) -> ScaledProgramme:
    """The programme in the solver's units."""
    hessian, gradient, compliance, offset, bounds = programme
    m = len(gradient)
    to_hessian, to_gradient, rows = np.empty((m, m)), np.empty(m), np.empty((m, m))
    lower, upper, box_lower, box_upper = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
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
    trace = hessian.sum() + gradient.sum() + offset.sum() + compliance.sum()
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
    )


@njit(cache=True)
def unscaled(unknowns: np.ndarray, multipliers: np.ndarray, scale: np.ndarray, lower: np.ndarray, upper: np.ndarray):
    """Tensions (m,) N within their bounds, and how far below the lower one the programme would like each (m,) N, 0 where that bound is
    not active; free of the solver's last bits.

    unknowns: m scaled tensions first; multipliers: those of m rows, then of the box.
    """
    m = len(scale)
    tension, unwanted = np.empty(m), np.empty(m)
    for i in range(m):
        tension[i] = min(max(np.rint(unknowns[i] * scale[i] / _QUANTUM) * _QUANTUM, lower[i]), upper[i])
        # The Hessian's diagonal is one, so a multiplier is also the step that would undo it.
        unwanted[i] = np.rint(max(0.0, -multipliers[m + i]) * scale[i] / _QUANTUM) * _QUANTUM
    return tension, unwanted
