"""How often a lost equilibrium is searched for.

A search takes a second, in which a controller would hear nothing that leads away from where there is no equilibrium. So it is repeated less
and less often while it is in vain, and does not begin at once where the load has hardly moved since there was an equilibrium:
whoever took that step can take it back.
"""

import numpy as np

from gravcomp.full_model.cable_input import CableInput

# Steps before a search, the first and the longest pause.
_FIRST_PAUSE, _LONGEST_PAUSE = 50, 3200
# What counts as hardly moved, as a share of the gravity and of the robot's length.
_GRAVITY_JUMP, _CABLE_JUMP = 0.2, 0.02


class SearchPace:
    """Counts the steps of a robot of `length` (m) that found no equilibrium nearby."""

    def __init__(self, length: float):
        self._length = length
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next search may be at once."""
        self._pause = self._remaining = 0
        self._found: tuple[np.ndarray, np.ndarray | None] | None = None

    def found(self, gravity: np.ndarray, cables: CableInput) -> None:
        """An equilibrium was found for this load."""
        self._pause = 0
        self._found = gravity.copy(), None if cables.wound is None else cables.wound.copy()

    def may_search(self, gravity: np.ndarray, cables: CableInput) -> bool:
        """Whether to search now; asked at every step without equilibrium."""
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
        if self._found is None:
            return True
        before, wound = self._found
        if wound is None or cables.wound is None or np.linalg.norm(gravity - before) > _GRAVITY_JUMP * np.linalg.norm(gravity):
            return True
        moved = np.abs(cables.wound - wound)
        return bool(
            (np.isnan(cables.wound) != np.isnan(wound)).any() or np.nanmax(moved, initial=0.0) > _CABLE_JUMP * self._length
        )
