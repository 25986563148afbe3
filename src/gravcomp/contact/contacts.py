"""What touches: places, gaps and forces of one equilibrium."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Contacts:
    """c places where the robot touches, in soft_base.

    obstacle (c,): number in the scene; names (c): of the obstacles; station (c,): 0 at the base to 1 at the tip; position (c, 3)
    on the robot's surface in m; normal (c, 3): out of the obstacle; force (c, 3) on the robot in N; gap (c,) in m; sliding (c,):
    whether it slides or sticks.
    """

    obstacle: np.ndarray
    station: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    sliding: np.ndarray
    names: tuple[str, ...] = ()

    @staticmethod
    def none() -> "Contacts":
        """Return no contact."""
        whole = np.zeros(0, dtype=np.int64)
        return Contacts(
            whole, np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=np.bool_)
        )

    def __len__(self) -> int:
        """Return the number of places."""
        return len(self.obstacle)

    @property
    def sentence(self) -> str:
        """The place with the largest force, in words; empty without contact."""
        if not len(self):
            return ""
        force = self.normal_force
        k = int(np.argmax(force))
        place = ", ".join(f"{1e3 * x:.1f}" for x in self.position[k])
        others = f", the largest of {len(self)} places" if len(self) > 1 else ""
        return f"'{self.names[k]}' at ({place}) mm with {force[k]:.3g} N{others}"

    @property
    def normal_force(self) -> np.ndarray:
        """Force (c,) out of the obstacle in N."""
        return (self.force * self.normal).sum(axis=1)
