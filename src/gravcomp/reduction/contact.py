"""Contact of the reduced model with the obstacles of a scene: the method of `full_model.contact` in r unknowns, compiled.

The stations' p, f_1 and f_2 are linear in q. A factor is used for a second step where the first one was short. The equilibrium is
reached when a step moves no station by more than the tolerance, or, after a short one, when neither the forces out of balance, by
the last factor, nor the gaps at the new shape ask for more than a part of that.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from gravcomp.contact.condensed import contact_forces
from gravcomp.contact.contacts import Contacts
from gravcomp.contact.place_forces import (
    Pressed,
    forces_at,
    missed,
    pressed_places,
    remember,
    remembered,
    rubbing,
    turning,
    yielding,
)
from gravcomp.contact.places import Places, empty_places, find_places
from gravcomp.contact.surface import ContactSurface
from gravcomp.full_model.contact import TOUCHED, FullContact
from gravcomp.reduction.body import Body, Point, elastic_force, elastic_stiffness, point_at
from gravcomp.reduction.cholesky import factorise, solve
from gravcomp.reduction.law_deviation import KeptStiffness, forget
from gravcomp.reduction.reduced_cables import add_stiffness, lacking, stretch
from gravcomp.rounding import REORDERED
from gravcomp.scene.distance import SceneArrays

# A factor is used again after a step below this part of the longest one.
_SHORT = 0.05
# Of the tolerance: what is left after a step that is not repeated.
_LEFT = 0.2


class Touching(NamedTuple):
    """What contact needs: scene, surface, rest (s, 3, 3) and change (9 s, r) of the stations' p, f_1, f_2; and the memory.

    start (s, 3, 3): stations at the last equilibrium; force (k, slots, 3) in N: of `places.remember`; pull (1, r): force of
    contact on the coordinates; rubs: whether any obstacle has friction; margin: m, nearer places are candidates.
    """

    scene: SceneArrays
    surface: ContactSurface
    rest: np.ndarray
    change: np.ndarray
    start: np.ndarray
    force: np.ndarray
    pull: np.ndarray
    rubs: bool
    margin: float


class ReducedContact:
    """Contact of a reduced model. Remembers the forces at the places as guesses for the next solution."""

    def __init__(self, full: FullContact, section_change: np.ndarray):
        """full: contact of the full model; section_change (s, 3, 3, r): changes of its stations' p, f_1, f_2."""
        self._full, self._change = full, np.ascontiguousarray(section_change.reshape(-1, section_change.shape[-1]))
        self._rest = full.sections_at_rest
        self.forget()

    def forget(self) -> None:
        """Forget the forces, for a start from another shape."""
        self.force = np.zeros((len(self._full.arrays.kind), self._full.surface.slots, 3))
        self._pull = np.zeros((1, self._change.shape[1]))
        self._last: tuple[Places, np.ndarray, np.ndarray, np.ndarray, Pressed] | None = None

    def take_over(self, basis: np.ndarray) -> None:
        """Take the forces of the full model's last solution as guesses; basis (3 n_free, r)."""
        self.force, self._pull = self._full.force.copy(), (self._full.pull @ basis)[None]

    def hand_over(self) -> None:
        """Give the forces of the last solution to the full model as guesses."""
        self._full.force[:] = self.force

    def sections(self, q: np.ndarray) -> np.ndarray:
        """Return p, f_1, f_2 (s, 3, 3) of the stations at q (r,)."""
        return self._rest + (self._change @ q).reshape(-1, 3, 3)

    def touching(self, q: np.ndarray, gravity: np.ndarray) -> Touching:
        """Return the arrays for a step from q (r,) under gravity (3,)."""
        full = self._full
        scene = full.place(gravity)
        return Touching(
            scene, full.surface, self._rest, self._change, self.sections(q), self.force.copy(), self._pull.copy(),
            full.rubbing, full.margin,
        )  # fmt: skip

    def keep(
        self,
        touching: Touching,
        places: Places,
        forces: np.ndarray,
        held: np.ndarray,
        by_tension: np.ndarray,
        pressed: Pressed,
    ) -> None:
        """Keep what a step has found."""
        self.force, self._pull = touching.force, touching.pull
        self._last = (places, forces, held, by_tension, pressed) if len(pressed.numbers) else None

    def contacts(self) -> Contacts:
        """Return what touched in the last solution."""
        return Contacts.none() if self._last is None else self._full.described(*self._last)


@njit(cache=True, fastmath=REORDERED)
def tracked_touching(
    body: Body, point: Point, q: np.ndarray, tension: np.ndarray, weight: np.ndarray, wound: np.ndarray, given: np.ndarray,
    pulling: np.ndarray, scale: float, offset: np.ndarray, kept: KeptStiffness,
    iterations: int, longest_step: float, near: float, tolerance: float, calm: float, touching: Touching,
) -> tuple[
    bool, Point, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, Places, np.ndarray, np.ndarray, np.ndarray,
    Pressed,
]:  # fmt: skip
    """Return what `tracking._tracked` returns, then places, their forces (c, 3), states (c,) and changes by tension (c, m).

    Last come the pressed places. Writes the memory of `touching`.
    """
    m, r, start, cables = len(tension), len(q), point, body.cables
    rest, change, stations = touching.rest, touching.change, len(touching.rest)
    compliance, answer = np.zeros((m, m)), np.zeros((m, r))
    converged, residual, reuse, before = False, np.inf, False, 0.0
    factor = np.zeros((r, r))
    forces, held, pressing = np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, m))
    sections = rest + (change @ q).reshape(stations, 3, 3)
    places = empty_places(0)
    for iteration in range(iterations):
        stress = scale * point.strain + offset
        rough = before > calm and not reuse
        if not reuse:
            if iteration:
                forget(kept)
            matrix = elastic_stiffness(body, point, q, stress, scale, kept)
            add_stiffness(cables, point.tendons, tension, matrix)
            definite, factor = factorise(matrix)
            if not definite:
                break
        columns = np.empty((r, m + 2))
        columns[:, 0] = weight - elastic_force(point, stress)
        columns[:, 1] = columns[:, 0] + touching.pull[0]
        columns[:, 2:] = point.tendons.force_jacobian.T
        solve(factor, columns)
        own = stretch(cables, point.tendons)
        y, of_cables = columns[:, 0].copy(), np.ascontiguousarray(columns[:, 2:])
        foreseen = (change @ (columns[:, 1] + of_cables @ tension)).reshape(stations, 3, 3)
        places = find_places(
            touching.scene,
            touching.surface,
            sections,
            np.ascontiguousarray(foreseen[:, 0]),
            touching.margin,
            touching.force,
        )
        count = len(places.row)
        pressed, rub = remembered(places, touching.force)
        turns, moves, bend = turning(places, pressed)
        friction, slid = np.zeros(0), np.zeros(0)
        if touching.rubs:
            friction, slid = rubbing(touching.scene, touching.surface, places, touching.start, sections, TOUCHED)
        directions = _directions(places, change, len(slid) > 0, turns, moves)
        rows = np.empty((m + len(directions), r))
        rows[:m], rows[m:] = point.tendons.jacobian, directions
        moved = np.ascontiguousarray(directions.T)
        solve(factor, moved)
        answers = np.empty((r, len(rows)))
        answers[:, :m], answers[:, m:] = of_cables, moved
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
        touching.pull[0] = force[m:] @ directions
        forces = forces_at(places, force[m : m + count].copy(), force[m + count : m + count + len(slid)].copy())
        remember(places, forces, touching.force)
        pressing = by_tension[m : m + count].copy()
        compliance = np.ascontiguousarray(whole[:m]) @ by_tension
        answer = np.ascontiguousarray((answers @ by_tension).T)
        step = y + answers @ force
        wide = (change @ step).reshape(stations, 3, 3)[:, 0]
        size = np.sqrt((wide**2).sum(axis=1).max())
        if not np.isfinite(size):
            break
        share = min(1.0, longest_step / size) if size > 0.0 else 1.0
        q, tension = q + share * step, tension + share * (force[:m] - tension)
        point = point_at(body, q, pulling)
        sections = rest + (change @ q).reshape(stations, 3, 3)
        before = share * size
        reuse = not rough and before < _SHORT * longest_step
        if rough or not settled or size >= near:
            continue
        out = weight - elastic_force(point, scale * point.strain + offset) + tension @ point.tendons.force_jacobian
        out += touching.pull[0]
        if size >= tolerance:
            further = out.copy()
            solve(factor, further.reshape(r, 1))
            if not len(given):
                further += lacking(cables, point.tendons, tension, compliance, wound) @ answer
            wide = (change @ further).reshape(stations, 3, 3)[:, 0]
            off = missed(touching.scene, places, softness, force[m : m + count], sections)
            if max(np.sqrt((wide**2).sum(axis=1).max()), off) > _LEFT * tolerance:
                continue
        converged, residual = True, np.sqrt(out @ (body.force_norm @ out))
        break
    if not converged:
        point = start
        forget(kept)
    displacement = point.tendons.displacement + stretch(cables, point.tendons) * tension
    touched = pressed_places(touching.scene, touching.surface, places, forces, sections)
    return converged, point, q, tension, displacement, compliance, answer, residual, places, forces, held, pressing, touched


@njit(cache=True)
def _directions(places: Places, change: np.ndarray, rubs: bool, turns: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Rows (k, r) of `contact.condensed`: normals, both tangents of each place if `rubs`, then those of `turning`."""
    count, r = len(places.row), change.shape[1]
    first = 3 * count if rubs else count
    result = np.zeros((first + len(turns) + len(moves), r))
    for i in range(count):
        for n in range(3):
            share = places.share[i, n]
            if share == 0.0:
                continue
            base = 9 * (places.first[i] + n)
            for j in range(3):
                middle = change[base + j]
                one, two = change[base + 3 + j], change[base + 6 + j]
                x, y = places.own[i]
                for a in range(r):
                    here = share * (middle[a] + x * one[a] + y * two[a])
                    result[i, a] += places.normal[i, j] * here
                    if rubs:
                        result[count + 2 * i, a] += places.around[i, j] * here
                        result[count + 2 * i + 1, a] += places.along[i, j] * here
    for k in range(len(turns)):
        i = turns[k]
        for n in range(3):
            base = 9 * (places.first[i] + n)
            for j in range(3):
                weight = places.share[i, n] * places.around[i, j]
                for a in range(r):
                    result[first + k, a] += weight * change[base + j, a]
    for k in range(len(moves)):
        i = moves[k]
        x, y = places.own[i]
        for n in range(3):
            base = 9 * (places.first[i] + n)
            for j in range(3):
                weight = places.tilt[i, n] * places.normal[i, j]
                for a in range(r):
                    here = change[base + j, a] + x * change[base + 3 + j, a] + y * change[base + 6 + j, a]
                    result[first + len(turns) + k, a] += weight * here
    return result
