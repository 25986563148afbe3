"""Contact of the reduced model with the obstacles of a scene: what the steps of `contact_step` need, and what they leave."""

from typing import NamedTuple

import numpy as np

from gravcomp.contact.contacts import Contacts
from gravcomp.contact.place_forces import Pressed
from gravcomp.contact.surface import ContactSurface
from gravcomp.full_model.contact import FullContact
from gravcomp.full_model.touch import Touch
from gravcomp.reduction.clear_of_obstacles import ClearOfObstacles
from gravcomp.scene.distance import SceneArrays


class Touching(NamedTuple):
    """What contact needs: scene, surface, change (9 s, r) of the stations' p, f_1, f_2, that of p alone (3 s, r); and the memory.

    start (s, 3, 3): stations at the last equilibrium; pressed (k, slots): what pressed there; force (k, slots, 3) in N: of
    `remember`; pull (1, r): force of contact on the coordinates; rubs: whether any obstacle has friction; margin: m, nearer
    places are candidates.
    """

    scene: SceneArrays
    surface: ContactSurface
    change: np.ndarray
    middle_change: np.ndarray
    start: np.ndarray
    pressed: np.ndarray
    force: np.ndarray
    pull: np.ndarray
    rubs: bool
    margin: float


class ReducedContact:
    """Contact of a reduced model. Remembers the forces at the places as guesses for the next solution.

    clear: whether the robot is clear of the obstacles; then steps are made without contact.
    """

    def __init__(self, full: FullContact, section_change: np.ndarray):
        """full: contact of the full model; section_change (s, 3, 3, r): changes of its stations' p, f_1, f_2."""
        r = section_change.shape[-1]
        self._full, self._change = full, np.ascontiguousarray(section_change.reshape(-1, r))
        self._middle_change = np.ascontiguousarray(section_change[:, 0].reshape(-1, r))
        self._rest = full.sections_at_rest
        self.clear = ClearOfObstacles(full, section_change)
        self.forget()

    def forget(self) -> None:
        """Forget the forces, for a start from another shape."""
        self.force = np.zeros((len(self._full.arrays.kind), self._full.surface.slots, 3))
        self._pull = np.zeros((1, self._change.shape[1]))
        self._pressed: Pressed | None = None
        self.clear.forget()

    def take_over(self, touch: Touch, basis: np.ndarray) -> None:
        """Take the forces of a solution of the full model as guesses; basis (3 n_free, r)."""
        self.force, self._pull = touch.force.copy(), (touch.pull @ basis)[None]

    def hand_over(self, u: np.ndarray) -> Touch:
        """Return the forces of the last solution as guesses for the full model at the displacements u (n, 3)."""
        return self._full.touch_at(u, self.force, self._pressed)

    def sections(self, q: np.ndarray) -> np.ndarray:
        """Return p, f_1, f_2 (s, 3, 3) of the stations at q (r,)."""
        return self._rest + (self._change @ q).reshape(-1, 3, 3)

    def touching(self, q: np.ndarray, gravity: np.ndarray) -> Touching:
        """Return the arrays for a step from q (r,) under gravity (3,)."""
        full = self._full
        scene = full.place(gravity)
        return Touching(
            scene, full.surface, self._change, self._middle_change, self.sections(q), np.asarray(self.force.any(axis=2)),
            self.force.copy(), self._pull.copy(), full.rubbing, full.margin,
        )  # fmt: skip

    def keep(self, touching: Touching, pressed: Pressed) -> None:
        """Keep what a step has found."""
        self.force, self._pull, self._pressed = touching.force, touching.pull, pressed

    def contacts(self) -> Contacts:
        """Return what touched in the last solution."""
        return self._full.described(self._pressed)
