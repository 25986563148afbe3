"""What drives the cables: displacements or tensions."""

import dataclasses

import numpy as np

from gravcomp.cables.friction import Sliding
from gravcomp.cables.slack import taut_tensions


@dataclasses.dataclass(frozen=True)
class CableInput:
    """Displacement or tension of m cables; with neither, all cables are released.

    wound (m,): displacement in m to which each cable is pulled in, NaN for a released cable; tension (m,) in N, takes precedence.
    """

    wound: np.ndarray | None = None
    tension: np.ndarray | None = None

    def tensions(self, compliance: np.ndarray, free: np.ndarray, taut: np.ndarray) -> np.ndarray:
        """Return the tensions (m,) in N for the response displacement = compliance tension + free; taut (m,): first guess."""
        if self.tension is not None:
            return self.tension
        if self.wound is None:
            return np.zeros(len(free))
        return taut_tensions(compliance, free, self.wound, taut)

    def arrays(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the input to `count` cables for compiled functions.

        The first array (m,) is the displacement to which each cable is pulled in, NaN for released ones. The second is the given
        tension (m,), which takes precedence, or (0,) if none is given.
        """
        if self.tension is not None:
            return np.full(count, np.nan), self.tension
        return np.full(count, np.nan) if self.wound is None else self.wound, np.zeros(0)

    def sliding(self, before: Sliding, tension: np.ndarray, displacement: np.ndarray) -> Sliding:
        """Return the sliding after this input to cables with `tension` and `displacement` (m,)."""
        return before.after(self.wound, self.tension, tension, displacement)

    def part(self, origin: np.ndarray, fraction: float) -> "CableInput":
        """Return the input at a fraction of the load: interpolated from the displacements `origin` (m,), or from tension 0."""
        if self.tension is not None:
            return CableInput(tension=fraction * self.tension)
        if self.wound is None:
            return self
        return CableInput(wound=origin + fraction * (self.wound - origin))
