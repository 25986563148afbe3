"""A spring between one cross-section and a place and direction that are fixed in the base frame.

It acts on the section's s = (p, f_1, f_2) (`mesh.sections`), so that its stiffness is constant.
"""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Spring:
    """Draws the section at `station` (0 at the base to 1 at the tip) to `at` (3, 3): its p in m, f_1 and f_2.

    stiffness (3,): of p in N/m, of f_1 and f_2 in N m.
    """

    station: float
    at: np.ndarray
    stiffness: tuple[float, float, float]

    constant = False

    def pulls(self, place: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Return the forces (3, 3) on p, f_1 and f_2 of its section, as `Wrench.pulls`."""
        pulls: np.ndarray = np.array(self.stiffness)[:, None] * (self.at - np.array([place, one, two]))
        return pulls

    @property
    def slopes(self) -> np.ndarray:
        """The derivatives (9, 9) of the forces on p, f_1 and f_2 by these."""
        return -np.diag(np.repeat(self.stiffness, 3))
