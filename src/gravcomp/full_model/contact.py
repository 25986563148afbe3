"""Contact of the full model with the obstacles of a scene.

In every Newton step the places near an obstacle are found at the present shape (`contact.places`). Their directions are further
right-hand sides of the factor that the step has anyway, A X = C^T, next to those of the cables. What remains is small and
dense: the compliance S of cables and places, from which forces and states follow (`contact.condensed`).
"""

import numpy as np

from gravcomp.contact.condensed import OPEN, SLIDING, STICKING, contact_forces
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
from gravcomp.contact.surface import contact_surface
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.supports import SupportedFactor, unstable_motions
from gravcomp.mechanics.block_matrix import Factor
from gravcomp.mesh.sections import section_functionals
from gravcomp.scene.distance import SceneArrays
from gravcomp.scene.scene import Scene

# Parts of the radius: a place nearer than the first is a candidate; one nearer than the second at the last equilibrium rubs.
NEAR, TOUCHED = 0.02, 1e-3


class FullContact:
    """Contact of a model with a scene. Remembers the forces at the places as guesses for the next solution.

    Attributes: scene; arrays: its obstacles where gravity last placed them; surface; sections_at_rest (s, 3, 3); margin: m,
    nearer places are candidates; rubbing: whether any obstacle has friction; allowed: depth in m by which obstacles are lowered,
    for loads applied in steps; of the last solution: pull (3 n_free,): forces on the unknowns; force (k, slots, 3): those of
    `places.remember`; settled: whether all conditions of contact hold; longest: largest step in m that cannot pass over an
    obstacle.
    """

    def __init__(self, model: MeshedModel, scene: Scene):
        """Raises ValueError for a robot that has no outlines along its axis."""
        from scipy.sparse import csr_matrix

        self.scene, self.surface, self._model = scene, contact_surface(model.robot), model
        self.arrays = scene.arrays
        rows = section_functionals(model.mesh, self.surface.place)
        self._rows = csr_matrix(rows)
        self._of_vectors = [csr_matrix(rows[v::3, : model.n_free]) for v in range(3)]
        self.margin = NEAR * float(self.surface.radius.min())
        self.sections_at_rest = self.sections(np.zeros_like(model.mesh.nodes))
        self.allowed = 0.0
        self.rubbing = bool((scene.arrays.friction > 0.0).any())
        self.reset()

    def reset(self) -> None:
        """Forget the forces: nothing touches."""
        self.force = np.zeros((len(self.arrays.kind), self.surface.slots, 3))
        self._start = self.sections_at_rest
        self._none_pressed = np.zeros(self.force.shape[:2], dtype=np.bool_)  # here those that press have no gap
        self.longest = np.inf
        self.pull, self.settled = np.zeros(3 * self._model.n_free), True
        self._last: tuple[Places, np.ndarray, np.ndarray, np.ndarray] | None = None

    def sections(self, u: np.ndarray) -> np.ndarray:
        """Return the sections (s, 3, 3) p, f_1, f_2 of the stations at the displacements u (n, 3)."""
        return (self._rows @ (self._model.mesh.nodes + u)).reshape(-1, 3, 3)

    def begin(self, u: np.ndarray, gravity: np.ndarray) -> None:
        """Start a step from the equilibrium u (n, 3): friction counts from there. gravity (3,) places what is in the world."""
        self.place(gravity)
        self._start = self.sections(u)

    def place(self, gravity: np.ndarray) -> SceneArrays:
        """Place what is in the world for gravity (3,), and return the obstacles."""
        self.arrays = self.scene.under_gravity(gravity)
        return self.arrays

    def changes(self, fields: np.ndarray) -> np.ndarray:
        """Return changes (s, 3, 3, r) of the stations' p, f_1, f_2 by fields (r, n, 3) of displacements."""
        return np.stack([(self._rows @ field).reshape(-1, 3, 3) for field in fields], axis=-1)

    def squeezed(self, u: np.ndarray) -> str:
        """Return a sentence on where walls leave less room than the robot needs at u (n, 3), empty without any."""
        return squeezed(self.arrays, self.scene.names, self.surface, self.sections(u))

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
        model, m = self._model, len(state.tension)
        wound, given = cables.arrays(m)
        solved = factor.solve(np.column_stack([out, out + self.pull, state.tendons.force_jacobian.T]))
        y, foreseen, answer = solved[:, 0], solved[:, 1], solved[:, 2:]
        if supported is not None:  # without the walls it would move the wrong way
            foreseen = supported.held(out + self.pull)
        jacobian, stretch = state.tendons.jacobian, np.diag(model.tendons.stretch(state.tendons))
        compliance, free = jacobian @ answer + stretch, state.tendons.displacement + jacobian @ y
        tension = cables.tensions(compliance, free, state.tension > 0.0)
        sections = self.sections(state.u)
        moved = self._of_vectors[0] @ (foreseen + answer @ tension).reshape(-1, 3)
        places = find_places(self.arrays, self.surface, sections, moved, self.margin + self.allowed, self.force)
        if not len(places.row):
            state.compliance, state.answer = compliance, answer
            self._keep(places, np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, m)), np.zeros(len(y)))
            return y + answer @ tension, tension
        pressed, rub = remembered(places, self.force)
        turns, moves, bend = turning(places, pressed)
        directions, friction, slid = self._directions(places, turns, moves), np.zeros(0), np.zeros(0)
        arrays, count = self.arrays, len(places.row)
        if self.rubbing:
            friction, slid = rubbing(arrays, self.surface, places, self._start, sections, TOUCHED, self._none_pressed)
        columns = np.hstack([answer, factor.solve(directions.T)])
        rows = np.vstack([jacobian, directions])
        whole = rows @ columns
        whole[:m, :m] += stretch
        free = rows @ y
        free[:m] += state.tendons.displacement
        free[m + count : m + count + len(slid)] += slid
        softness = yielding(arrays, self.surface, places)
        force, change, held, self.settled = contact_forces(
            whole, free, wound, given, state.tension, places.gap + self.allowed,
            softness, friction, bend, pressed, rub,
        )  # fmt: skip
        if supported is not None:
            soft = np.concatenate([np.zeros(m), softness, np.zeros(len(whole) - m - count)])
            self.settled &= not self._buckles(supported, whole + np.diag(soft), force, held, bend, wound, given)
        state.compliance, state.answer = whole[:m] @ change, columns @ change
        forces = forces_at(places, force[m : m + count], force[m + count : m + count + len(slid)])
        remember(places, forces, self.force)
        self._keep(places, forces, held, change[m : m + count], force[m:] @ directions)
        return y + columns @ force, force[:m]

    def pressed_sections(self) -> list[np.ndarray]:
        """Return the rows (n,) of the middles of the sections that walls pressed in the last solution."""
        pressed = np.flatnonzero(self.force.any(axis=(0, 2)))
        stations = np.unique(np.minimum(pressed, len(self.surface.place) - 1))
        return [self._rows[[3 * station]].toarray()[0] for station in stations]

    def _buckles(
        self, supported: SupportedFactor, compliance: np.ndarray, force: np.ndarray, held: np.ndarray, bend: np.ndarray,
        wound: np.ndarray, given: np.ndarray,
    ) -> bool:  # fmt: skip
        """Whether the robot would leave this equilibrium.

        compliance (k, k): with those of the walls; the others are arguments and results of `contact.condensed`.
        """
        m, count, turning = len(wound), len(held), len(force) - len(bend)
        rows = [a for a in range(m) if not len(given) and np.isfinite(wound[a]) and force[a] > 0.0]
        rows += [m + i for i in range(count) if held[i] != OPEN]
        rows += [m + count + 2 * i + v for i in range(count) if held[i] == STICKING for v in range(2)]
        rows += range(turning, len(force))
        return unstable_motions(supported.negative, compliance[np.ix_(rows, rows)], bend) > 0

    def contacts(self, u: np.ndarray) -> Contacts:
        """Return what touched in the last solution, with the gaps at the displacements u (n, 3)."""
        if self._last is None or not len(self._last[0].row):
            return Contacts.none()
        places, forces, held, by_tension = self._last
        pressed = pressed_places(self.arrays, self.surface, places, forces, self.sections(u))
        return self.described(places, forces, held, by_tension, pressed)

    def described(
        self, places: Places, forces: np.ndarray, held: np.ndarray, by_tension: np.ndarray, pressed: Pressed
    ) -> Contacts:
        """Return the pressed places.

        Of all places: forces (c, 3), states (c,) of `contact.condensed`, and changes (c, m) of the normal forces by the tensions.
        """
        chosen = pressed.numbers
        obstacle = self.arrays.obstacle[places.row[chosen]]
        return Contacts(
            obstacle=obstacle,
            station=pressed.along / self._model.length,
            position=pressed.position,
            normal=places.normal[chosen],
            force=forces[chosen],
            gap=pressed.gap,
            sliding=held[chosen] == SLIDING,
            by_tension=by_tension[chosen],
            names=tuple(self.scene.names[k] for k in obstacle),
        )

    def _keep(self, places: Places, forces: np.ndarray, held: np.ndarray, by_tension: np.ndarray, pull: np.ndarray) -> None:
        if not len(places.row):
            self.force[:], self.settled = 0.0, True
        self._last, self.pull = (places, forces, held, by_tension), pull
        self.longest = float(self.surface.radius.min()) if len(places.row) else np.inf

    def _directions(self, places: Places, turns: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Rows (r, 3 n_free) of `contact.condensed`: normals, tangents if anything rubs, then those of `turning`."""
        from scipy.sparse import csr_matrix

        count, n = len(places.row), self._model.n_free
        three, start = (places.first[:, None] + np.arange(3)).ravel(), 3 * np.arange(count + 1)
        share, tilt = (
            csr_matrix((weights.ravel(), three, start), shape=(count, len(self.surface.place)))
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
