"""Pace of the searches for a lost equilibrium.

A search takes a second, during which a controller gets no shape and cannot react. So a search that finds nothing is repeated
less and less often. The first search waits if the load has changed little since the last equilibrium: the controller can take
that step back.
"""

import numpy as np

from gravcomp.full_model.cable_input import CableInput

# Pause between two searches in steps: the first and the longest one.
_FIRST_PAUSE, _LONGEST_PAUSE = 50, 3200
# A change of gravity or cables beyond this is a jump: fraction of the gravity, and of the robot's length.
_GRAVITY_JUMP, _CABLE_JUMP = 0.2, 0.02


class SearchPace:
    """Counts the steps without equilibrium of a robot of `length` m, and decides when to search."""

    def __init__(self, length: float):
        self._length = length
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps; the next search may start immediately."""
        self._pause = self._remaining = 0
        self._found: tuple[np.ndarray, np.ndarray | None] | None = None

    def found(self, gravity: np.ndarray, cables: CableInput) -> None:
        """Record that an equilibrium was found for this load."""
        self._pause = 0
        self._found = gravity.copy(), None if cables.wound is None else cables.wound.copy()

    @property
    def last_gravity(self) -> np.ndarray | None:
        """Gravity (3,) of the last equilibrium in m/s^2; None if there is none."""
        return None if self._found is None else self._found[0]

    def may_search(self, gravity: np.ndarray, cables: CableInput) -> bool:
        """Return whether to search now. Called at every step without equilibrium."""
        if self._pause == 0:
            self._pause = _FIRST_PAUSE
            self._remaining = 0 if self._has_jumped(gravity, cables) else _FIRST_PAUSE
        else:
            self._remaining -= 1
        if self._remaining > 0:
            return False
        self._remaining, self._pause = self._pause, min(2 * self._pause, _LONGEST_PAUSE)
        return True

    def _has_jumped(self, gravity: np.ndarray, cables: CableInput) -> bool:
        """Return whether the load has changed much since the last equilibrium."""
        if self._found is None:
            return True
        before, wound = self._found
        if wound is None or cables.wound is None or np.linalg.norm(gravity - before) > _GRAVITY_JUMP * np.linalg.norm(gravity):
            return True
        moved = np.abs(cables.wound - wound)
        return bool(
            (np.isnan(cables.wound) != np.isnan(wound)).any() or np.nanmax(moved, initial=0.0) > _CABLE_JUMP * self._length
        )
