"""Contact of the reduced model with the obstacles of a scene: the method of `full_model.contact` in r unknowns, compiled.

The stations' p, f_1 and f_2 are linear in q. A factor is used for a second step where the first one was short. The equilibrium is
reached when a step moves no station by more than the tolerance.

A step that is near is followed by corrections, which keep its places, its factor and its compliance S: only the forces out of
balance are new, and the gaps and normals at the same stations. Let C_0 be the rows of the places in S, and C_1 those with
the new normals. The forces f of the last solution act along C_1; those of the next one are sought along C_0,

    A dq = w - f_el(q) + (C_1 - C_0)^T f + C_0^T f',        v = S f' + C_0 A^-1 (w - f_el(q) + (C_1 - C_0)^T f),

so that the forces act along C_1 where they change no more. Corrections shrink like the part by which normals and stiffness have
changed, and take a fifth of the time of a step. After a step that is longer than the margin within which places are candidates,
it is seen whether another station has come into an obstacle.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.condensed import contact_forces
from gravcomp.contact.moved_places import follow, unseen_depth
from gravcomp.contact.place_forces import (
    Pressed,
    forces_at,
    pressed_places,
    remember,
    remembered,
    rubbing,
    slid_by,
    turning,
    yielding,
)
from gravcomp.contact.places import Places, empty_places, find_places
from gravcomp.full_model.contact import TOUCHED
from gravcomp.reduction.body import Body, Point, elastic_force, point_at, stiffness_factor
from gravcomp.reduction.cholesky import solve
from gravcomp.reduction.contact import Touching
from gravcomp.reduction.contact_rows import directions_of, pull_of
from gravcomp.reduction.law_deviation import KeptStiffness, forget
from gravcomp.reduction.reduced_cables import stretch
from gravcomp.rounding import REORDERED

# A factor is used again after a step below this part of the longest one.
_SHORT = 0.05
# Corrections of a step, and the part of the last one to which each has to shrink.
_CORRECTIONS, _CONTRACTION = 4, 0.3


class Step(NamedTuple):
    """What a Newton step from q (r,) with k rows of cables, places and turning has found, for its corrections.

    q (r,); moving: first of the rows of places that move along the robot; factor (r, r) of the stiffness; rows (k, r); answers
    (r, k) = A^-1 rows^T; compliance (k, k); cable_force (m, r): Jacobian of the cables' forces; bend, friction and softness of
    `contact.condensed`; wound and given: of `CableInput.arrays`.
    """

    q: np.ndarray
    moving: int
    factor: np.ndarray
    rows: np.ndarray
    answers: np.ndarray
    compliance: np.ndarray
    cable_force: np.ndarray
    bend: np.ndarray
    friction: np.ndarray
    softness: np.ndarray
    wound: np.ndarray
    given: np.ndarray


@njit(cache=True, fastmath=REORDERED)
def tracked_touching(
    body: Body, point: Point, expected: np.ndarray, q: np.ndarray, tension: np.ndarray, weight: np.ndarray, wound: np.ndarray,
    given: np.ndarray, pulling: np.ndarray, scale: float, offset: np.ndarray, kept: KeptStiffness,
    iterations: int, longest_step: float, near: float, tolerance: float, calm: float, touching: Touching,
) -> tuple[
    bool, Point, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, Pressed,
]:  # fmt: skip
    """Return what `tracking._tracked` returns, then the pressed places. Writes the memory of `touching`."""
    m, r, start, expected_first, cables = len(tension), len(q), point, expected, body.cables
    of_law = len(body.deviation.weight) > 0
    change, stations = touching.change, len(touching.start)
    compliance, answer = np.zeros((m, m)), np.zeros((m, r))
    converged, residual, reuse, before = False, np.inf, False, 0.0
    factor = np.zeros((r, r))
    forces, held, pressing = np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, m))
    sections = touching.start  # linear in q: each step adds what it moves
    places = empty_places(np.int64(0))  # no literal, as in `find_places`
    for iteration in range(iterations):
        stress = scale * point.strain + offset
        rough = before > calm and not reuse
        if not reuse:
            if iteration:
                forget(kept)
            definite, factor = stiffness_factor(body, point, q, tension, scale * expected + offset, scale, kept)
            if not definite:
                break
        columns = np.empty((r, m + 2))
        columns[:, 0] = weight - elastic_force(point, stress)
        columns[:, 1] = columns[:, 0] + touching.pull[0]
        columns[:, 2:] = point.tendons.force_jacobian.T
        solve(factor, columns)
        own = stretch(cables, point.tendons)
        y, of_cables = columns[:, 0].copy(), np.ascontiguousarray(columns[:, 2:])
        foreseen = (touching.middle_change @ (columns[:, 1] + of_cables @ tension)).reshape(stations, 3)
        places = find_places(
            touching.scene,
            touching.surface,
            sections,
            foreseen,
            touching.margin,
            touching.force,
        )
        count = len(places.row)
        pressed, rub = remembered(places, touching.force)
        turns, moves, bend = turning(places, pressed)
        friction, slid = np.zeros(0), np.zeros(0)
        if touching.rubs:
            friction, slid = rubbing(
                touching.scene, touching.surface, places, touching.start, sections, TOUCHED, touching.pressed
            )
        directions = directions_of(places, change, len(slid) > 0, turns, moves)
        rows = np.empty((m + len(directions), r))
        rows[:m], rows[m:] = point.tendons.jacobian, directions
        of_places = np.ascontiguousarray(directions.T)
        solve(factor, of_places)
        answers = np.empty((r, len(rows)))
        answers[:, :m], answers[:, m:] = of_cables, of_places
        whole = rows @ answers
        free = rows @ y
        for a in range(m):
            whole[a, a] += own[a]
            free[a] += point.tendons.displacement[a]
        free[m + count : m + count + len(slid)] += slid
        softness = yielding(touching.scene, touching.surface, places)
        force, by_tension, held, settled = contact_forces(
            whole, free, wound, given, tension, places.gap, softness, friction, bend, pressed, rub
        )
        plain = count + len(slid)  # rows of the places' forces; the others are those of turning
        touching.pull[0] = force[m:] @ directions
        forces = forces_at(places, force[m : m + count].copy(), force[m + count : m + plain].copy())
        step, cable_force = y + answers @ force, point.tendons.force_jacobian
        moved = (change @ step).reshape(stations, 3, 3)
        size = np.sqrt((moved[:, 0] ** 2).sum(axis=1).max())
        if not np.isfinite(size):
            break
        share = min(1.0, longest_step / size) if size > 0.0 else 1.0
        origin = q
        q, tension = q + share * step, tension + share * (force[:m] - tension)
        expected = point.strain + share * (step @ point.jacobian)
        point = point_at(body, q, pulling)
        sections = sections + share * moved
        before = share * size
        reuse = not rough and before < _SHORT * longest_step
        if not rough and settled and size < near:
            linear = Step(
                origin, m + plain + len(turns), factor, rows, answers, whole, cable_force, bend, friction, softness, wound, given
            )
            way = size
            for _ in range(_CORRECTIONS):
                if size < tolerance:
                    break
                out = weight - elastic_force(point, scale * point.strain + offset)
                lag, step, corrected, by_tension, held, settled = _corrected(
                    linear, touching, places, out, point, q, tension, force, sections
                )
                moved = (change @ step).reshape(stations, 3, 3)
                shift = np.sqrt((moved[:, 0] ** 2).sum(axis=1).max())
                if not settled or not shift < _CONTRACTION * size:
                    break
                force, size, way = corrected, shift, way + shift
                touching.pull[0] = lag + force[m:] @ directions
                forces = forces_at(places, force[m : m + count].copy(), force[m + count : m + plain].copy())
                q, tension = q + step, force[:m].copy()
                expected = point.strain + step @ point.jacobian
                point = point_at(body, q, pulling)
                sections = sections + moved
            converged = size < tolerance and (
                way < touching.margin or unseen_depth(touching.scene, touching.surface, places, sections, tolerance) <= tolerance
            )
        if of_law:
            expected = point.strain
        remember(places, forces, touching.force)
        if converged:
            pressing = by_tension[m : m + count].copy()
            compliance = np.ascontiguousarray(whole[:m]) @ by_tension
            answer = np.ascontiguousarray((answers @ by_tension).T)
            out = weight - elastic_force(point, scale * point.strain + offset) + tension @ point.tendons.force_jacobian
            out += touching.pull[0]
            residual = np.sqrt(out @ (body.force_norm @ out))
            break
    if not converged:
        point, expected = start, expected_first
        forget(kept)
    displacement = point.tendons.displacement + stretch(cables, point.tendons) * tension
    if not converged:
        places, forces, held = empty_places(np.int64(0)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    touched = pressed_places(touching.scene, touching.surface, places, forces, held, pressing, sections)
    return converged, point, expected, q, tension, displacement, compliance, answer, residual, touched


@njit(cache=True)
def _corrected(
    linear: Step, touching: Touching, places: Places, out: np.ndarray, point: Point, q: np.ndarray, tension: np.ndarray,
    force: np.ndarray, sections: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]:  # fmt: skip
    """Return (C_1 - C_0)^T f (r,), the correction (r,), and forces, changes, states and end of `contact.condensed`.

    out (r,): weight less internal force; point, q (r,), tension (m,), force (k,) and sections (s, 3, 3): after the last step.
    Lets the places follow the sections.
    """
    m, count, rubs = len(tension), len(places.row), len(linear.friction) > 0
    plain = 3 * count if rubs else count
    follow(touching.scene, touching.surface, places, sections)
    normal, tangential = force[m : m + count].copy(), force[m + count : m + plain].copy()
    lag = (
        pull_of(places, forces_at(places, normal, tangential), touching.change)
        - force[m : m + plain] @ linear.rows[m : m + plain]
    )
    step = out + lag + tension @ (point.tendons.force_jacobian - linear.cable_force)
    solve(linear.factor, step.reshape(len(step), 1))
    free = linear.rows @ step
    free[:m] += point.tendons.displacement
    free[linear.moving :] += linear.rows[linear.moving :] @ (q - linear.q)
    if rubs:
        free[m + count : m + plain] += slid_by(places, touching.start, sections)
    found, by_tension, held, settled = contact_forces(
        linear.compliance, free, linear.wound, linear.given, tension, places.gap, linear.softness, linear.friction, linear.bend,
        normal, tangential.reshape(-1, 2),
    )  # fmt: skip
    return lag, step + linear.answers @ found, found, by_tension, held, settled
