"""A user who stands by while the virtual robot runs: pulls its tip by hand, and puts a wall next to it."""

from typing import Any

import numpy as np

from gravcomp.config import from_mapping
from gravcomp.scene import SceneSection
from gravcomp.scene.declared import ITSELF as OWN_NAME
from gravcomp.scene.scene import Scene
from gravcomp.virtual.dynamics import MovingRod
from gravcomp.virtual.hand import Hand, HandOrder
from gravcomp.virtual.placed_wall import PlacedWall, parse_wall
from gravcomp.virtual.surroundings import ITSELF, RodSurroundings
from gravcomp.virtual.true_robot import TrueRobot


class Bystander:
    """What the user does to the rod. Attribute hand: the user's hand."""

    def __init__(self, rod: MovingRod, true: TrueRobot, around: RodSurroundings | None, obstacles: tuple[str, ...]):
        """around, obstacles: what is around the rod without the user, and its names."""
        self._rod, self._true, self._around, self._obstacles = rod, true, around, obstacles
        self.hand = Hand(rod.model)
        self._wall: PlacedWall | None = None

    def order_hand(self, mapping: Any, source: str, time: float) -> None:
        """Let the hand pull as in `mapping`, the keys of `HandOrder`, or 'release'. Raises ConfigError, which names `source`."""
        if mapping == "release":
            self.hand.release()
        else:
            self.hand.hold(np.array(from_mapping(HandOrder, mapping, source=source).place), time)

    def order_wall(self, mapping: Any, source: str) -> None:
        """Put the wall where `mapping` says, in the keys of `scene.planes`, or take it away: 'clear'. Raises ConfigError.

        Also for a body from a file that has no section somewhere. What is refused changes nothing.
        """
        if mapping == "clear":
            if self._wall is not None:
                self._wall.place(None)
            return
        if self._wall is None:
            around = self._around or RodSurroundings.of(self._rod.model, self._true, Scene(SceneSection()))
            self._wall = PlacedWall(self._rod, around, self.hand.force_max)
        self._wall.place(parse_wall(mapping, source, self._wall.length, self._wall.base_radius))

    def step(self, dt: float, time: float) -> np.ndarray:
        """Move the wall for `dt` s and return the hand's force (3,) N in soft_base on the tip, at `time` s."""
        if self._wall is not None:
            self._wall.step(dt)
        if not self.hand.holds:
            return self.hand.force
        rod = self._rod
        return self.hand.pull(rod.orientation[0].T @ (rod.position[-1] - rod.position[0]), time)

    @property
    def plane(self) -> tuple[np.ndarray, np.ndarray] | None:
        """A point (3,) m and the normal (3,) of the wall where it is now, in soft_base; None without a wall."""
        return None if self._wall is None else self._wall.plane

    def names(self, rows: np.ndarray) -> tuple[str, ...]:
        """Return the names of the obstacles of so many rows of the rod's scene; ITSELF: the rod itself."""
        if self._around is None:
            numbers = np.zeros(0, int)
        else:
            numbers = self._around.walls.scene.obstacle
        placed = self._wall.name if self._wall else ""
        known = [*(self._obstacles[number] for number in numbers), *([placed] * (rows.max(initial=-1) + 1 - len(numbers)))]
        return tuple(OWN_NAME if row == ITSELF else known[row] for row in rows)
