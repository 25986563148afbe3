"""A reduced model as arrays for compiled steps, and its state at one point of its coordinates."""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.reduction.cholesky import factorise
from gravcomp.reduction.law_deviation import DeviationPoint, KeptStiffness, LawDeviation, deviation_at, near_stiffness
from gravcomp.reduction.reduced_cables import ReducedCables, ReducedTendons, add_stiffness, tendons_at
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.strain_polynomials import strain_at, tangent

# Distance at which the stiffness of a law's deviation is used again, as a fraction of the model's reach.
_NEAR = 0.03


class Body(NamedTuple):
    """Arrays of a reduced model.

    linear and quadratic of the elasticity, and the law's deviation from it; force_norm (r, r); tip (3, r): d tip / dq; cables.
    """

    linear: np.ndarray
    quadratic: np.ndarray
    deviation: LawDeviation
    force_norm: np.ndarray
    tip: np.ndarray
    cables: ReducedCables


class Point(NamedTuple):
    """A reduced model at coordinates q: J^T (r, k) and strain (k,) of the elasticity, the law's deviation, and the cables."""

    jacobian: np.ndarray
    strain: np.ndarray
    deviation: DeviationPoint
    tendons: ReducedTendons


def body_of(model: ReducedModel) -> Body:
    """Return the arrays of the model for compiled functions."""
    elasticity, tip = model.elasticity, np.ascontiguousarray(model.section_change[-1, 0])
    return Body(elasticity.linear, elasticity.quadratic, model.deviation, model.force_norm, tip, model.cables)


@njit(cache=True)
def point_at(body: Body, q: np.ndarray, pulling: np.ndarray) -> Point:
    """Return the model at q (r,). pulling (m,): sliding direction of each cable, see `tendons_at`."""
    jacobian, strain = strain_at(body.linear, body.quadratic, q)
    return Point(jacobian, strain, deviation_at(body.deviation, q), tendons_at(body.cables, q, pulling))


@njit(cache=True)
def elastic_force(point: Point, stress: np.ndarray) -> np.ndarray:
    """Return the internal force (r,) for the stress (k,) of the elasticity: the strain, and damping and creep in motion."""
    return point.jacobian @ stress + point.deviation.force


@njit(cache=True)
def elastic_stiffness(
    body: Body, point: Point, q: np.ndarray, stress: np.ndarray, scale: float, kept: KeptStiffness
) -> np.ndarray:
    """Return the lower triangle of the stiffness (r, r) at q (r,), where the model is `point`.

    stress (k,): as in `elastic_force`; scale: its derivative by the strain; kept: of the law's deviation.
    """
    stiffness = tangent(point.jacobian, body.quadratic, stress, scale)
    if len(body.deviation.weight):
        stiffness += near_stiffness(body.deviation, point.deviation, q, kept)
    return stiffness


@njit(cache=True)
def stiffness_factor(
    body: Body, point: Point, q: np.ndarray, tension: np.ndarray, stress: np.ndarray, scale: float, kept: KeptStiffness
) -> tuple[bool, np.ndarray]:
    """Return what `cholesky.factorise` does for the stiffness of body and cables under `tension` (m,) in N at q (r,).

    stress, scale and kept: of `elastic_stiffness`.
    """
    matrix = elastic_stiffness(body, point, q, stress, scale, kept)
    add_stiffness(body.cables, point.tendons, tension, matrix)
    return factorise(matrix)


def kept_stiffness(model: ReducedModel) -> KeptStiffness:
    """Return an empty memory for the stiffness of the law's deviation."""
    return KeptStiffness.none(model.size, _NEAR * model.reach)
