"""One time step of the reduced model as one compiled function, as in `tracking`."""

import numpy as np
from numba import njit

from gravcomp.cables.slack import pivoted
from gravcomp.reduction.body import Body, Point, elastic_force, elastic_stiffness, point_at
from gravcomp.reduction.cholesky import factorise, solve
from gravcomp.reduction.law_deviation import KeptStiffness
from gravcomp.reduction.reduced_cables import add_stiffness, lacking, stretch
from gravcomp.rounding import REORDERED

_MOST_ITERATIONS = 16


@njit(cache=True, fastmath=REORDERED)
def motion_step(
    body: Body, point: Point, q: np.ndarray, tension: np.ndarray, rest: np.ndarray, inertia: np.ndarray, weight: np.ndarray,
    wound: np.ndarray, given: np.ndarray, now: float, scale: float, offset: np.ndarray, kept: KeptStiffness, tolerance: float,
) -> tuple[bool, np.ndarray, np.ndarray, Point, np.ndarray, float]:  # fmt: skip
    """Solve the balance of a step, rest + inertia (q - q_n) + now g(q) = 0, by Newton's method.

    Every iteration has its own factor, which is cheap here; the correction that it gives after the step decides whether another
    iteration is needed. Returns whether the step converged, and at its end q, tension, point, force g and the norm of the force
    out of balance in N.

    Parameters
    ----------
    body
        Arrays of the model.
    point, q, tension
        State at the start of the step, n.
    rest
        (r,) constant part of the balance.
    inertia
        (r, r) factor of q - q_n.
    weight
        (r,) force of gravity.
    wound, given
        Of `CableInput.arrays`.
    now
        Weight of the forces at the end of the step.
    scale, offset
        The stress is scale eps + offset (k,).
    kept
        Of `elastic_stiffness`.
    tolerance
        Largest correction of the tip in m.

    """
    m, r, start, cables = len(tension), len(q), q, body.cables
    frictionless = np.zeros(m)
    compliance, answer, of_tip = np.zeros((m, m)), np.zeros((m, r)), np.zeros((3, r))
    for iteration in range(_MOST_ITERATIONS + 1):
        stress = scale * point.strain + offset
        force = elastic_force(point, stress) - weight - tension @ point.tendons.jacobian
        out = rest + inertia @ (q - start) + now * force
        if iteration > 0:
            pull = np.zeros(m) if len(given) else lacking(cables, point.tendons, tension, compliance, wound)
            left = of_tip @ out - body.tip @ (pull @ answer)
            if (left**2).sum() < tolerance**2:
                return True, q, tension, point, force, np.sqrt(out @ (body.force_norm @ out))
        elastic = now * elastic_stiffness(body, point, q, stress, scale, kept) + inertia
        matrix = elastic.copy()
        add_stiffness(cables, point.tendons, now * tension, matrix)
        definite, factor = factorise(matrix)
        if not definite:  # under large tensions: without their stiffness the direction is still right
            definite, factor = factorise(elastic)
        if not definite:
            break
        columns = np.empty((r, m + 4))
        columns[:, 0] = -out
        columns[:, 1 : m + 1] = now * point.tendons.jacobian.T
        columns[:, m + 1 :] = body.tip.T
        solve(factor, columns)
        solved = np.ascontiguousarray(columns.T)
        y, answer, of_tip = solved[0], solved[1 : m + 1], solved[m + 1 :]
        compliance = point.tendons.jacobian @ answer.T
        if len(given):
            wanted = given
        else:
            free = point.tendons.displacement + point.tendons.jacobian @ y - compliance @ tension
            held, own = np.isfinite(wound), stretch(cables, point.tendons)
            for i in range(m):
                compliance[i, i] += own[i]
            wanted = pivoted(compliance, wound - free, held, held & (tension > 0.0))
        q = q + y + (wanted - tension) @ answer
        if not np.isfinite(q.sum()):
            break
        tension, point = wanted, point_at(body, q, frictionless)
    return False, q, tension, point, weight, np.inf
