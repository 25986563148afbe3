"""Friction of cables in their guides: the share of a cable's tension that reaches each piece of its path.

Capstan friction (Euler and Eytelwein): lambda_k = lambda exp(-+ mu theta_k), where theta_k is the sum of the angles up to piece
k; minus while the cable is pulled in, plus while it is paid out.
"""

import numpy as np

from gravcomp.description import Cable


class Friction:
    """Capstan friction of m cables."""

    def __init__(self, cables: tuple[Cable, ...]):
        self._coefficient = np.array([cable.friction for cable in cables])

    def any(self) -> bool:
        """Return whether any cable has friction; its forces then depend on the past motion."""
        return bool(self._coefficient.any())

    def acts(self, pulling: np.ndarray) -> bool:
        """Return whether any cable with friction slides. pulling (m,): 1 pulled in, -1 paid out, 0 for no friction."""
        return bool((self._coefficient * pulling).any())

    def shares(self, cable: np.ndarray, tangent: np.ndarray, pulling: np.ndarray) -> np.ndarray:
        """Return (s,) the tension in every piece over the tension of its cable.

        cable (s,): the cable of each piece, in order along the cables; tangent (s, 3) of the pieces; pulling (m,) as in `acts`.
        """
        same = cable[1:] == cable[:-1]
        cosine = np.clip((tangent[1:] * tangent[:-1]).sum(axis=1), -1.0, 1.0)
        turned = np.cumsum(np.concatenate([[0.0], np.where(same, np.arccos(cosine), 0.0)]))
        first = np.searchsorted(cable, np.arange(len(pulling)))
        return np.exp(-(self._coefficient * pulling)[cable] * (turned - turned[first][cable]))
