"""A reduced model as arrays for compiled steps, and its state at one point of its coordinates."""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.full_model.cable_input import CableInput
from gravcomp.reduction.reduced_cables import ReducedCables, ReducedTendons, tendons_at
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.strain_polynomials import strain_at


class Body(NamedTuple):
    """Arrays of a reduced model: linear and quadratic of the elasticity; force_norm (r, r); tip (3, r): d tip / dq; cables."""

    linear: np.ndarray
    quadratic: np.ndarray
    force_norm: np.ndarray
    tip: np.ndarray
    cables: ReducedCables


class Point(NamedTuple):
    """A reduced model at coordinates q: J^T (r, k) and strain (k,) of the elasticity, and the cables."""

    jacobian: np.ndarray
    strain: np.ndarray
    tendons: ReducedTendons


def body_of(model: ReducedModel) -> Body:
    """Return the arrays of the model for compiled functions."""
    elasticity, tip = model.elasticity, np.ascontiguousarray(model.section_change[-1, 0])
    return Body(elasticity.linear, elasticity.quadratic, model.force_norm, tip, model.cables)


@njit(cache=True)
def point_at(body: Body, q: np.ndarray) -> Point:
    """Return the model at q (r,)."""
    jacobian, strain = strain_at(body.linear, body.quadratic, q)
    return Point(jacobian, strain, tendons_at(body.cables, q))


def cable_arrays(cables: CableInput, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the input for compiled functions.

    The first array (m,) is the displacement to which each cable is pulled in, NaN for released ones. The second is the given
    tension (m,), which takes precedence, or (0,) if none is given.
    """
    if cables.tension is not None:
        return np.full(count, np.nan), cables.tension
    return np.full(count, np.nan) if cables.wound is None else cables.wound, np.zeros(0)
