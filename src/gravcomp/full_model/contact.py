"""Contact of the full model with the obstacles of a scene.

In every Newton step the places near an obstacle are found at the present shape (`contact.places`). Their directions are further
right-hand sides of the factor that the step has anyway, A X = C^T, beside those of the cables. What remains is small and
dense: the compliance S of cables and places, from which forces and states follow (`contact.condensed`).
"""

import numpy as np

from gravcomp.contact.condensed import OPEN, SLIDING, contact_forces
from gravcomp.contact.contacts import Contacts
from gravcomp.contact.places import Places, all_gaps, find_places, positions
from gravcomp.contact.surface import contact_surface
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.equilibrium import Equilibrium
from gravcomp.full_model.model import MeshedModel
from gravcomp.mechanics.block_matrix import BlockCholesky
from gravcomp.mesh.sections import section_functionals
from gravcomp.scene.distance import gap_to
from gravcomp.scene.scene import Scene

# Parts of the radius: a place nearer than the first is a candidate; one nearer than the second at the last equilibrium rubs.
_NEAR, _TOUCHED = 0.02, 1e-3


class FullContact:
    """Contact of a model with a scene. Remembers the forces and states of the places as guesses for the next solution.

    Attributes: scene; surface; allowed: depth in m by which obstacles are lowered, for loads applied in steps; of the last
    solution: pull (3 n_free,): forces on the unknowns; settled: whether all conditions of contact hold; longest: largest step
    in m that cannot pass over an obstacle.
    """

    def __init__(self, model: MeshedModel, scene: Scene):
        """Raises ValueError for a robot that has no outlines along its axis."""
        from scipy.sparse import csr_matrix

        self.scene, self.surface, self._model = scene, contact_surface(model.robot), model
        rows = section_functionals(model.mesh, self.surface.place)
        self._rows = csr_matrix(rows)
        self._of_vectors = [csr_matrix(rows[v::3, : model.n_free]) for v in range(3)]
        self._margin = _NEAR * float(self.surface.radius.min())
        self.allowed = 0.0
        self.rubbing = bool((scene.arrays.friction > 0.0).any())
        self.reset()

    def reset(self) -> None:
        """Forget the forces: nothing touches."""
        shape = len(self.scene.arrays.kind), len(self.surface.place)
        self._pressed, self._state = np.zeros(shape), np.full(shape, OPEN)
        self._start = self.sections(np.zeros_like(self._model.mesh.nodes))
        self.longest = np.inf
        self.pull, self.settled = np.zeros(3 * self._model.n_free), True
        self._last: tuple[Places, np.ndarray] | None = None

    def sections(self, u: np.ndarray) -> np.ndarray:
        """Return the sections (s, 3, 3) p, f_1, f_2 of the stations at the displacements u (n, 3)."""
        return (self._rows @ (self._model.mesh.nodes + u)).reshape(-1, 3, 3)

    def begin(self, u: np.ndarray, gravity: np.ndarray) -> None:
        """Start a step from the equilibrium u (n, 3): friction counts from there. gravity (3,) places what is in the world."""
        self.scene.under_gravity(gravity)
        self._start = self.sections(u)

    def depth(self, u: np.ndarray) -> float:
        """Return in m how deep the robot is in an obstacle at the displacements u (n, 3); 0 outside."""
        return max(0.0, -float(self.gaps(u).min(initial=0.0)))

    def gaps(self, u: np.ndarray) -> np.ndarray:
        """Return the gaps (k, s) in m of all stations to all rows of the scene; those far away are underestimated."""
        sections, shape = self.sections(u), self._pressed.shape
        reach = np.full(shape[1], self._margin)
        return all_gaps(self.scene.arrays, self.surface, sections, reach, np.zeros((*shape, 2)), np.zeros((*shape, 3)))

    def respond(
        self, state: Equilibrium, factor: BlockCholesky, out: np.ndarray, cables: CableInput
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the step (3 n_free,) and the tensions (m,) for the forces `out` (3 n_free,) without cables and contact.

        Sets compliance and answer of `state`, which hold what touches in contact.
        """
        model, m = self._model, len(state.tension)
        wound, given = cables.arrays(m)
        solved = factor.solve(np.column_stack([out, out + self.pull, state.tendons.force_jacobian.T]))
        y, foreseen, answer = solved[:, 0], solved[:, 1], solved[:, 2:]
        jacobian, stretch = state.tendons.jacobian, np.diag(model.tendons.stretch(state.tendons))
        compliance, free = jacobian @ answer + stretch, state.tendons.displacement + jacobian @ y
        tension = cables.tensions(compliance, free, state.tension > 0.0)
        sections = self.sections(state.u)
        moved = self._of_vectors[0] @ (foreseen + answer @ tension).reshape(-1, 3)
        places = find_places(self.scene.arrays, self.surface, sections, moved, self._margin + self.allowed, self._pressed > 0.0)
        if not len(places.row):
            state.compliance, state.answer = compliance, answer
            self._keep(places, np.zeros((0, 3)), np.zeros(len(y)))
            return y + answer @ tension, tension
        directions, start = self._directions(places), np.zeros(0)
        arrays, stations = self.scene.arrays, places.station
        friction = np.zeros(0)
        if self.rubbing:
            before = positions(places, self._start)
            touched = self._gaps_of(places, before) < _TOUCHED * self.surface.radius[stations]
            friction = arrays.friction[places.row] * touched
            slid = positions(places, sections) - before
            start = np.column_stack([(slid * places.around).sum(axis=1), (slid * places.along).sum(axis=1)]).ravel()
        count = len(places.row)
        columns = np.hstack([answer, factor.solve(directions.T)])
        rows = np.vstack([jacobian, directions])
        whole = rows @ columns
        whole[:m, :m] += stretch
        free = rows @ y
        free[:m] += state.tendons.displacement
        free[m + count : m + count + len(start)] += start
        pressed, held = self._pressed[places.row, stations], self._state[places.row, stations]
        with np.errstate(divide="ignore"):
            yielding = 1.0 / (arrays.stiffness[places.row] * self.surface.length[stations])
        force, change, self.settled = contact_forces(
            whole, free, wound, given, state.tension > 0.0, places.gap + self.allowed, yielding, friction, places.curvature,
            pressed, held,
        )  # fmt: skip
        self._pressed[:], self._state[:] = 0.0, OPEN
        self._pressed[places.row, stations], self._state[places.row, stations] = np.maximum(force[m : m + count], 0.0), held
        state.compliance, state.answer = whole[:m] @ change, columns @ change
        forces = force[m : m + count, None] * places.normal
        if self.rubbing:
            rub = force[m + count : m + 3 * count].reshape(count, 2)
            forces = forces + rub[:, :1] * places.around + rub[:, 1:] * places.along
        self._keep(places, forces, force[m:] @ directions)
        return y + columns @ force, force[:m]

    def contacts(self, u: np.ndarray) -> Contacts:
        """Return what touched in the last solution, with the gaps at the displacements u (n, 3)."""
        assert self._last is not None
        places, forces = self._last
        position = positions(places, self.sections(u))
        pressed = (forces * places.normal).sum(axis=1) > 0.0
        row, station = places.row[pressed], places.station[pressed]
        return Contacts(
            obstacle=self.scene.arrays.obstacle[row],
            station=self.surface.place[station] / self._model.length,
            position=position[pressed],
            normal=places.normal[pressed],
            force=forces[pressed],
            gap=self._gaps_of(places, position)[pressed],
            sliding=self._state[row, station] == SLIDING,
        )

    def _keep(self, places: Places, forces: np.ndarray, pull: np.ndarray) -> None:
        if not len(places.row):
            self._pressed[:], self._state[:], self.settled = 0.0, OPEN, True
        self._last, self.pull = (places, forces), pull
        self.longest = float(self.surface.radius.min()) if len(places.row) else np.inf

    def _gaps_of(self, places: Places, points: np.ndarray) -> np.ndarray:
        """Gaps (c,) between the obstacles of the places and points (c, 3)."""
        normal = np.zeros(3)
        return np.array([gap_to(self.scene.arrays, row, point, normal) for row, point in zip(places.row, points)])

    def _directions(self, places: Places) -> np.ndarray:
        """Rows (r, 3 n_free) of `contact.condensed`: normals, tangents if anything rubs, tangents of the middle."""
        from scipy.sparse import csr_matrix

        count, n = len(places.row), self._model.n_free
        share = csr_matrix(
            (places.share.ravel(), (places.first[:, None] + np.arange(3)).ravel(), 3 * np.arange(count + 1)),
            shape=(count, len(self.surface.place)),
        )
        middle, one, two = ((share @ rows).toarray() for rows in self._of_vectors)
        point = middle + places.own[:, :1] * one + places.own[:, 1:] * two

        def along(rows: np.ndarray, direction: np.ndarray) -> np.ndarray:
            return (rows[:, :, None] * direction[:, None, :]).reshape(count, 3 * n)

        parts = [along(point, places.normal)]
        if self.rubbing:
            both = np.stack([along(point, places.around), along(point, places.along)], axis=1)
            parts.append(both.reshape(2 * count, 3 * n))
        parts.append(along(middle, places.around))
        return np.vstack(parts)
