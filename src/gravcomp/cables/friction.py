"""Friction of cables in their guides: the share of a cable's tension that reaches each piece of its path.

Capstan friction (Euler and Eytelwein): lambda_k = lambda exp(-+ mu theta_k), where theta_k is the sum of the angles up to piece
k, with the sheath between capstan and robot before the first; minus while the cable is pulled in, plus while it is paid out. The
cable stretches by the mean of the tension along it: of a sheath that turns evenly by theta, (1 - exp(-mu theta)) / (mu theta).

Friction turns round over a short way of the cable, in which line and sheath give: the sign above is a number from -1 to 1. With a
sign that jumped, commands that only tremble would reverse the friction of all cables with every sample.
"""

import dataclasses

import numpy as np

from gravcomp.description import Cable

# A change in m, or in N, that is rounding error.
_AT_REST = 1e-9

REVERSAL = 5e-4
"""Way of a cable over which its friction goes from none to whole, over the robot's length."""


class Friction:
    """Capstan friction of m cables.

    coefficient (m,); sheath_angle (m,) in rad and free_length (m,) in m: between capstan and robot.
    """

    def __init__(self, cables: tuple[Cable, ...]):
        self.coefficient = np.array([cable.friction or 0.0 for cable in cables])
        self.sheath_angle = np.array([cable.sheath_angle or 0.0 for cable in cables])
        self.free_length = np.array([cable.free_length or 0.0 for cable in cables])

    def any(self) -> bool:
        """Return whether any cable has friction; its forces then depend on the past motion."""
        return bool(self.coefficient.any())

    def acts(self, pulling: np.ndarray) -> bool:
        """Return whether any cable with friction slides. pulling (m,): 1 pulled in to -1 paid out, 0 for no friction."""
        return bool((self.coefficient * pulling).any())

    def shares(self, cable: np.ndarray, tangent: np.ndarray, pulling: np.ndarray) -> np.ndarray:
        """Return (s,) the tension in every piece over the tension of its cable.

        cable (s,): the cable of each piece, in order along the cables; tangent (s, 3) of the pieces; pulling (m,) as in `acts`.
        """
        same = cable[1:] == cable[:-1]
        cosine = np.clip((tangent[1:] * tangent[:-1]).sum(axis=1), -1.0, 1.0)
        turned = np.cumsum(np.concatenate([[0.0], np.where(same, np.arccos(cosine), 0.0)]))
        first = np.searchsorted(cable, np.arange(len(pulling)))
        angle = self.sheath_angle[cable] + turned - turned[first][cable]
        return np.exp(-(self.coefficient * pulling)[cable] * angle)

    def mean_shares(self, cable: np.ndarray, length: np.ndarray, share: np.ndarray, pulling: np.ndarray) -> np.ndarray:
        """Return (m,) the mean tension along each cable, free length included, over that at the capstan.

        cable, length and share (s,): of the pieces; pulling (m,) as in `acts`.
        """
        turn = self.coefficient * pulling * self.sheath_angle
        sheath = np.where(np.abs(turn) > 1e-9, -np.expm1(-turn) / np.where(turn == 0.0, 1.0, turn), 1.0)
        count = len(pulling)
        inside, weighted = np.bincount(cable, length, count), np.bincount(cable, share * length, count)
        return (self.free_length * sheath + weighted) / (self.free_length + inside)


@dataclasses.dataclass(frozen=True)
class Sliding:
    """Direction in which m cables slide, and the input that it follows from.

    direction (m,): 1 pulled in, -1 paid out, between them while friction turns round, 0 not moved yet; wound (m,): last
    displacement that was given in m, NaN: none; way: m of displacement from no friction to whole, 0: it is whole at once.
    """

    direction: np.ndarray
    wound: np.ndarray
    way: float = 0.0

    @staticmethod
    def none(count: int, length: float) -> "Sliding":
        """Return the state of `count` cables that have not moved, in a robot of `length` m."""
        return Sliding(np.zeros(count), np.full(count, np.nan), REVERSAL * length)

    def after(
        self, wound: np.ndarray | None, given: np.ndarray | None, tension: np.ndarray, displacement: np.ndarray
    ) -> "Sliding":
        """Return the state after an input: displacements `wound` (m,), tensions `given` (m,), or neither for released cables.

        tension and displacement (m,): of the cables before, with their stretch. A cable whose input does not change keeps its
        direction.
        """
        if given is not None:
            change = given - tension
        elif wound is None:
            change = -tension
        else:
            before = np.where(np.isnan(self.wound), displacement, self.wound)
            change = np.where(np.isnan(wound), -tension, wound - before)
        direction = np.where(np.abs(change) > _AT_REST, np.sign(change), self.direction)
        if given is None and wound is not None and self.way > 0.0:
            direction = np.where(np.isnan(wound), direction, np.clip(self.direction + change / self.way, -1.0, 1.0))
        return Sliding(direction, np.full(len(tension), np.nan) if wound is None else wound, self.way)
