"""Contact of the full model with the obstacles of a scene.

In every Newton step the places near an obstacle are found at the present shape (`contact.places`). Their directions are further
right-hand sides of the factor that the step has anyway, A X = C^T, next to those of the cables. What remains is small and
dense: the compliance S of cables and places, from which forces and states follow (`contact.condensed`).
"""

import contextlib
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gravcomp.contact.condensed import contact_forces
from gravcomp.contact.contacts import Contacts
from gravcomp.contact.place_forces import (
    Pressed,
    forces_at,
    pressed_places,
    remember,
    remembered,
    rubbing,
    turning,
    yielding,
)
from gravcomp.contact.places import Places, all_gaps, find_places
from gravcomp.contact.squeezed import squeezed
from gravcomp.contact.stability import leaves
from gravcomp.contact.surface import contact_surface
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.own_contact import OwnContact, OwnRows, OwnTouch
from gravcomp.full_model.supports import SupportedFactor
from gravcomp.full_model.touch import Touch
from gravcomp.mechanics.block_matrix import Factor
from gravcomp.mesh.sections import section_functionals
from gravcomp.scene.declared import ITSELF
from gravcomp.scene.distance import SceneArrays
from gravcomp.scene.scene import Scene

# Parts of the radius: a place nearer than the first is a candidate; one nearer than the second at the last equilibrium rubs.
NEAR, TOUCHED = 0.02, 1e-3
# Part of the radius by which a robot is pushed off an obstacle on which it is balanced.
KICK = 0.01
# Part of the radius by which a robot may move that is twice as far from itself.
_FREE = 0.25


class _Rows(NamedTuple):
    """Rows (r, 3 n_free) of `contact.condensed` in its order, and what it needs to know of them."""

    directions: np.ndarray
    gap: np.ndarray
    softness: np.ndarray
    friction: np.ndarray
    slid: np.ndarray
    bend: np.ndarray
    pressed: np.ndarray
    rub: np.ndarray


class FullContact:
    """Contact of a model with a scene.

    Attributes: scene; arrays: its obstacles where gravity last placed them; surface; sections_at_rest (s, 3, 3); margin: m,
    nearer places are candidates; rubbing: whether any obstacle has friction; allowed: depth in m by which obstacles are lowered,
    for loads applied in steps; touch: what touches in the solution that is sought, from the state at which `begin` started; own:
    contact of the robot with itself, if the scene has it.
    """

    def __init__(self, model: MeshedModel, scene: Scene):
        """Raises ValueError for a robot that has no outlines along its axis."""
        from scipy.sparse import csr_matrix

        self.scene, self.surface, self._model = scene, contact_surface(model.robot), model
        self.arrays = scene.arrays
        rows = section_functionals(model.mesh, self.surface.place)
        self._rows = csr_matrix(rows)
        self._of_vectors = [csr_matrix(rows[v::3, : model.n_free]) for v in range(3)]
        self._free_rows_transposed = csr_matrix(rows[:, : model.n_free].T) if scene.self_contact else None
        self.margin = NEAR * float(self.surface.radius.min())
        self.sections_at_rest = self.sections(np.zeros_like(model.mesh.nodes))
        self.allowed = 0.0
        self.rubbing = bool((scene.arrays.friction > 0.0).any())
        slots = len(self.arrays.kind), self.surface.slots
        none_pressed = np.zeros(slots, dtype=np.bool_)
        self._nothing = Touch(self.sections_at_rest, none_pressed, np.zeros((*slots, 3)), np.zeros(3 * model.n_free))
        self.touch = self._nothing
        self.own = OwnContact(model.robot, self.surface) if scene.self_contact else None

    def sections(self, u: np.ndarray) -> np.ndarray:
        """Return the sections (s, 3, 3) p, f_1, f_2 of the stations at the displacements u (n, 3)."""
        return (self._rows @ (self._model.mesh.nodes + u)).reshape(-1, 3, 3)

    @contextlib.contextmanager
    def without_friction(self) -> Iterator[None]:
        """Leave friction out meanwhile."""
        rubbing, self.rubbing = self.rubbing, False
        try:
            yield
        finally:
            self.rubbing = rubbing

    @property
    def longest(self) -> float:
        """Largest step in m that cannot pass over an obstacle."""
        solution = self.touch.solution
        return float(self.surface.radius.min()) if solution is not None and len(solution[0].row) else np.inf

    def free_way(self, u: np.ndarray) -> float:
        """Return how far in m the robot can go from u (n, 3) without touching anything; 0 where that is not looked at.

        That is where there are no obstacles, and the robot is far from itself: then the equilibrium needs no contact.
        """
        if self.own is None or len(self.arrays.kind):
            return 0.0
        way = _FREE * float(self.surface.radius.min())
        return 0.0 if self.own.is_near(self.sections(u), 2.0 * way) else way

    def way(self, u: np.ndarray, other: np.ndarray) -> float:
        """Return the longest way in m of a station between the displacements u and other (n, 3)."""
        return float(np.linalg.norm(self.sections(other)[:, 0] - self.sections(u)[:, 0], axis=1).max())

    def part_that_passes(self, u: np.ndarray, step: np.ndarray) -> float:
        """Return the part of a step (3 n_free,) from u (n, 3) in which no part of the robot passes another."""
        if self.own is None:
            return 1.0
        return self.own.part_that_passes(self.sections(u), self._of_vectors[0] @ step.reshape(-1, 3))

    def begin(self, state: Equilibrium, gravity: np.ndarray) -> None:
        """Start a step from a state with what touches there. gravity (3,) places what is in the world.

        Friction counts from an equilibrium: from this state, or else from the one from which the way to it began.
        """
        self.place(gravity)
        last = state.touch or self._nothing
        if state.converged:
            last = last._replace(start=self.sections(state.u), pressed=np.asarray(last.force.any(axis=2)))
        self.touch = last

    def touch_at(self, u: np.ndarray, force: np.ndarray, handed: Pressed | None) -> Touch:
        """Return what touches at the equilibrium u (n, 3) of another model: force (k, slots, 3) in N of `remember`."""
        pressed = np.asarray(force.any(axis=2))
        return self._nothing._replace(start=self.sections(u), pressed=pressed, force=force.copy(), handed=handed)

    def place(self, gravity: np.ndarray) -> SceneArrays:
        """Place what is in the world for gravity (3,), and return the obstacles."""
        self.arrays = self.scene.under_gravity(gravity)
        return self.arrays

    def changes(self, fields: np.ndarray) -> np.ndarray:
        """Return changes (s, 3, 3, r) of the stations' p, f_1, f_2 by fields (r, n, 3) of displacements."""
        return np.stack([(self._rows @ field).reshape(-1, 3, 3) for field in fields], axis=-1)

    def squeezed(self, u: np.ndarray, gravity: np.ndarray) -> str:
        """Return a sentence on where walls leave less room than the robot needs at u (n, 3), empty without any.

        gravity (3,) places what is in the world.
        """
        return squeezed(self.scene.under_gravity(gravity), self.scene.names, self.surface, self.sections(u))

    def depth(self, u: np.ndarray) -> float:
        """Return in m how deep the robot is in an obstacle at the displacements u (n, 3); 0 outside."""
        shape = len(self.arrays.kind), len(self.surface.place)
        reach = np.full(shape[1], self.margin)
        own, normal, asked = np.zeros((*shape, 2)), np.zeros((*shape, 3)), np.zeros(shape, dtype=np.bool_)
        gaps = all_gaps(self.arrays, self.surface, self.sections(u), reach, asked, own, normal)
        return max(0.0, -float(gaps.min(initial=0.0)))

    def respond(
        self, state: Equilibrium, factor: Factor, out: np.ndarray, cables: CableInput, supported: SupportedFactor | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the step (3 n_free,) and the tensions (m,) for the forces `out` (3 n_free,) without cables and contact.

        supported: in `factor`, where only the walls keep the robot from buckling. Sets compliance and answer of `state`, which
        hold what touches in contact.
        """
        model, m, last = self._model, len(state.tension), self.touch
        wound, given = cables.arrays(m)
        solved = factor.solve(np.column_stack([out, out + last.pull, state.tendons.force_jacobian.T]))
        y, foreseen, answer = solved[:, 0], solved[:, 1], solved[:, 2:]
        if supported is not None:  # without the walls it would move the wrong way
            foreseen = supported.held(out + last.pull)
        jacobian, stretch = state.tendons.jacobian, np.diag(model.tendons.stretch(state.tendons))
        compliance, free = jacobian @ answer + stretch, state.tendons.displacement + jacobian @ y
        tension = cables.tensions(compliance, free, state.tension > 0.0)
        sections = self.sections(state.u)
        moved = self._of_vectors[0] @ (foreseen + answer @ tension).reshape(-1, 3)
        places = find_places(self.arrays, self.surface, sections, moved, self.margin - self.allowed, last.force)
        own = None if self.own is None else self.own.rows(sections, moved, self.margin, last.own)
        if not len(places.row) and own is None:
            state.compliance, state.answer = compliance, answer
            self.touch = self._nothing._replace(start=last.start, pressed=last.pressed)
            return y + answer @ tension, tension
        turns, moves, bend = turning(places, remembered(places, last.force)[0])
        rows = self._place_rows(places, turns, moves, bend, sections)
        if own is not None:
            rows = self._with_own(rows, own)
        directions, count, walls = rows.directions, len(rows.gap), len(places.row)
        columns = np.hstack([answer, factor.solve(directions.T)])
        lines = np.vstack([jacobian, directions])
        whole = lines @ columns
        whole[:m, :m] += stretch
        free = lines @ y
        free[:m] += state.tendons.displacement
        turned = m + count + len(rows.slid)
        free[m + count : turned] += rows.slid
        force, change, held, settled = contact_forces(
            whole, free, wound, given, state.tension, rows.gap, rows.softness, rows.friction, rows.bend, rows.pressed, rows.rub
        )
        if supported is not None:
            soft = np.concatenate([np.zeros(m), rows.softness, np.zeros(len(whole) - m - count)])
            settled &= not leaves(supported.negative, whole + np.diag(soft), force, rows.friction, rows.bend, wound, given, count)
        state.compliance, state.answer = whole[:m] @ change, columns @ change
        tangential = force[m + count : m + count + 2 * walls] if self.rubbing else np.zeros(0)
        forces = forces_at(places, force[m : m + walls], tangential)
        by_slot = np.empty_like(last.force)
        remember(places, forces, by_slot)
        step = y + columns @ force
        if not settled:
            self._kick(step, columns[:, turned:], rows.bend)
        solution = places, forces, held[:walls], change[m : m + walls]
        itself = None if own is None else OwnTouch(own.places, force[m + walls : m + count], change[m + walls : m + count])
        self.touch = Touch(last.start, last.pressed, by_slot, force[m:] @ directions, settled, solution, own=itself)
        return step, force[:m]

    def _place_rows(
        self, places: Places, turns: np.ndarray, moves: np.ndarray, bend: np.ndarray, sections: np.ndarray
    ) -> "_Rows":
        """Return what `contact.condensed` needs to know of the places next to obstacles; the first rows of `bend` are turns."""
        pressed, rub = remembered(places, self.touch.force)
        friction, slid = np.zeros(0), np.zeros(0)
        if self.rubbing:
            last = self.touch
            friction, slid = rubbing(self.arrays, self.surface, places, last.start, sections, TOUCHED, last.pressed)
        softness = yielding(self.arrays, self.surface, places)
        directions = self._directions(places, turns, moves)
        return _Rows(directions, places.gap + self.allowed, softness, friction, slid, bend, pressed, rub)

    def _with_own(self, rows: "_Rows", own: OwnRows) -> "_Rows":
        """Return the rows with those of places where the robot touches itself, which do not rub."""
        walls, plain, more = len(rows.gap), len(rows.gap) + len(rows.slid), len(own.pressed)
        tangents = 2 * more if self.rubbing else 0
        none = np.zeros(more)
        return _Rows(
            directions=np.vstack([
                rows.directions[:walls], self._of_stations(own.gaps), rows.directions[walls:plain],
                np.zeros((tangents, rows.directions.shape[1])), rows.directions[plain:], self._of_stations(own.turning),
            ]),
            gap=np.concatenate([rows.gap, own.places.gap]),
            softness=np.concatenate([rows.softness, none]),
            friction=np.concatenate([rows.friction, none[: tangents // 2]]),
            slid=np.concatenate([rows.slid, np.zeros(tangents)]),
            bend=np.concatenate([rows.bend, own.bend]),
            pressed=np.concatenate([rows.pressed, own.pressed]),
            rub=np.vstack([rows.rub, np.zeros((more, 2))]),
        )  # fmt: skip

    def _of_stations(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (k, 9 s) for the displacements of the stations' p, f_1, f_2 as rows (k, 3 n_free) for the unknowns."""
        if not len(rows):
            return np.zeros((0, 3 * self._model.n_free))
        split = rows.reshape(len(rows), -1, 3)
        parts = [self._free_rows_transposed @ split[:, :, j].T for j in range(3)]
        return np.stack(parts, axis=-1).swapaxes(0, 1).reshape(len(rows), -1)

    def pressed_sections(self) -> list[np.ndarray]:
        """Return the rows (n,) of the middles of the sections that walls pressed in the last solution."""
        pressed = np.flatnonzero(self.touch.force.any(axis=(0, 2)))
        stations = np.unique(np.minimum(pressed, len(self.surface.place) - 1))
        return [self._rows[[3 * station]].toarray()[0] for station in stations]

    def _kick(self, step: np.ndarray, answers: np.ndarray, bend: np.ndarray) -> None:
        """Add to a short step (3 n_free,) a motion off the obstacles on which the robot may be balanced, as on top of a ball.

        answers (3 n_free, t): to forces along the tangents `around` at the middles; bend (t,): stiffness of those that turn.
        """
        away = answers @ np.sqrt(np.maximum(bend, 0.0))
        size, kick = float(np.abs(away).max()), KICK * float(self.surface.radius.min())
        if size > 0.0 and np.abs(step).max() < kick:
            step += (kick if away @ step >= 0.0 else -kick) / size * away

    def contacts(self, state: Equilibrium) -> Contacts:
        """Return what touches at a state."""
        if state.touch is None or state.touch.solution is None:
            return self.described(None if state.touch is None else state.touch.handed)
        places, forces, held, by_tension = state.touch.solution
        sections = self.sections(state.u)
        walls = self.described(pressed_places(self.arrays, self.surface, places, forces, held, by_tension, sections))
        if self.own is None:
            return walls
        return walls.and_own(self.own.contacts(state.touch.own, sections, len(self.scene.names), ITSELF))

    def described(self, pressed: Pressed | None) -> Contacts:
        """Return the pressed places with their obstacles."""
        if pressed is None or not len(pressed.row):
            return Contacts.none()
        obstacle = self.arrays.obstacle[pressed.row]
        return Contacts(
            obstacle=obstacle,
            station=pressed.along / self._model.length,
            position=pressed.position,
            normal=pressed.normal,
            force=pressed.force,
            gap=pressed.gap,
            sliding=pressed.sliding,
            by_tension=pressed.by_tension,
            names=tuple(self.scene.names[k] for k in obstacle),
        )

    def _directions(self, places: Places, turns: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Rows (r, 3 n_free) of `contact.condensed`: normals, tangents if anything rubs, then those of `turning`."""
        from scipy.sparse import csr_matrix

        count, n = len(places.row), self._model.n_free
        four, start = (places.first[:, None] + np.arange(4)).ravel(), 4 * np.arange(count + 1)
        share, tilt = (
            csr_matrix((weights.ravel(), four, start), shape=(count, len(self.surface.place)))
            for weights in (places.share, places.tilt)
        )

        def at(weights: csr_matrix, chosen: np.ndarray | slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
            middle, one, two = ((weights[chosen] @ rows).toarray() for rows in self._of_vectors)
            return middle, middle + places.own[chosen, :1] * one + places.own[chosen, 1:] * two

        middle, point = at(share)

        def along(rows: np.ndarray, direction: np.ndarray) -> np.ndarray:
            return (rows[:, :, None] * direction[:, None, :]).reshape(len(rows), 3 * n)

        parts = [along(point, places.normal)]
        if self.rubbing:
            both = np.stack([along(point, places.around), along(point, places.along)], axis=1)
            parts.append(both.reshape(2 * count, 3 * n))
        if len(turns):
            parts.append(along(middle[turns], places.around[turns]))
        if len(moves):
            parts.append(along(at(tilt, moves)[1], places.normal[moves]))
        return np.vstack(parts)
