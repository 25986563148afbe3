"""What touches: places, gaps and forces of one equilibrium, and the obstacles with what presses on each of them."""

import dataclasses
import functools

import numpy as np


@dataclasses.dataclass(frozen=True)
class ObstacleForces:
    """o obstacles that the robot touches, with what presses on each; in soft_base.

    names (o); force (o,): normal forces of its places, added, in N; position (o, 3): of the place with the largest one, in m;
    change (o, m): of the force by the cables' tensions, in N/N, while what touches goes on touching.
    """

    names: tuple[str, ...]
    force: np.ndarray
    position: np.ndarray
    change: np.ndarray

    @staticmethod
    @functools.cache
    def none() -> "ObstacleForces":
        """Return no obstacle."""
        return ObstacleForces((), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 0)))

    def __len__(self) -> int:
        """Return the number of obstacles."""
        return len(self.names)

    @property
    def largest(self) -> int:
        """Number of the obstacle with the largest force. Raises ValueError without any."""
        return int(np.argmax(self.force))

    @property
    def sentence(self) -> str:
        """The obstacle with the largest force, in words; empty without contact."""
        if not len(self):
            return ""
        k = self.largest
        others = f", the largest force on {len(self)} obstacles" if len(self) > 1 else ""
        return f"'{self.names[k]}' at ({in_mm(self.position[k])}) mm with {self.force[k]:.3g} N{others}"


def in_mm(place: np.ndarray) -> str:
    """Return a place (3,) in m as words in mm."""
    return ", ".join(f"{1e3 * x:.1f}" for x in place)


@dataclasses.dataclass(frozen=True)
class Contacts:
    """c places where the robot touches, in soft_base.

    obstacle (c,): number in the scene; names (c): of the obstacles; station (c,): 0 at the base to 1 at the tip; position (c, 3)
    on the robot's surface in m; normal (c, 3): out of the obstacle; force (c, 3) on the robot in N; gap (c,) in m; sliding (c,):
    whether it slides or sticks; by_tension (c, m): change of the normal force by the cables' tensions, in N/N; against (c,): the
    station of the other part, on which the opposite force acts, where the robot touches itself, else NaN; (0,): it does not.
    """

    obstacle: np.ndarray
    station: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    sliding: np.ndarray
    by_tension: np.ndarray
    names: tuple[str, ...] = ()
    against: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0))

    @staticmethod
    @functools.cache
    def none() -> "Contacts":
        """Return no contact."""
        whole, points = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        return Contacts(whole, np.zeros(0), points, points, points, np.zeros(0), np.zeros(0, dtype=np.bool_), np.zeros((0, 0)))

    def __len__(self) -> int:
        """Return the number of places."""
        return len(self.obstacle)

    def and_own(self, own: "Contacts") -> "Contacts":
        """Return these contacts with obstacles, and `own`, those of the robot with itself."""
        if not len(own) or not len(self):
            return own if len(own) else self
        both = {
            field.name: np.concatenate([getattr(self, field.name), getattr(own, field.name)])
            for field in dataclasses.fields(self)
            if field.name not in ("names", "against")
        }
        return Contacts(**both, names=self.names + own.names, against=np.concatenate([np.full(len(self), np.nan), own.against]))

    def by_obstacle(self) -> ObstacleForces:
        """Return what presses on each obstacle that is touched."""
        if not len(self):
            return ObstacleForces.none()
        numbers = np.unique(self.obstacle)
        force, own = self.normal_force, [np.flatnonzero(self.obstacle == number) for number in numbers]
        strongest = [places[np.argmax(force[places])] for places in own]
        return ObstacleForces(
            names=tuple(self.names[k] for k in strongest),
            force=np.array([force[places].sum() for places in own]),
            position=self.position[strongest],
            change=np.array([self.by_tension[places].sum(axis=0) for places in own]),
        )

    @property
    def normal_force(self) -> np.ndarray:
        """Force (c,) out of the obstacle in N."""
        return (self.force * self.normal).sum(axis=1)
