"""What touches at a state of the full model. It belongs to the state: who returns to an earlier state returns to its forces."""

from typing import NamedTuple

import numpy as np

from gravcomp.contact.place_forces import Pressed
from gravcomp.contact.places import Places
from gravcomp.full_model.own_contact import OwnTouch


class Touch(NamedTuple):
    """Forces of contact at a state: guesses for the next solution, and what is reported.

    Of the last equilibrium, from which friction counts: start (s, 3, 3), its sections; pressed (k, slots), what pressed there.
    force (k, slots, 3) in N: of `place_forces.remember`; pull (3 n_free,): forces on the unknowns in N; settled: whether all
    conditions of contact hold; solution: its places, their forces (c, 3) in N, states (c,) of `contact.condensed`, and changes
    (c, m) of the normal forces by the tensions; None where no place is near an obstacle. handed: what presses at a state of
    another model, which has no solution here. own: where the robot touches itself, None where it is not near itself.
    """

    start: np.ndarray
    pressed: np.ndarray
    force: np.ndarray
    pull: np.ndarray
    settled: bool = True
    solution: tuple[Places, np.ndarray, np.ndarray, np.ndarray] | None = None
    handed: Pressed | None = None
    own: OwnTouch | None = None
