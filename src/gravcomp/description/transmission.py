"""From motors to cables and back: delta = T u + s, with the displacements delta (m,) of cables and u (k,) at the capstans.

Most robots have one motor a cable, and both sides are the same numbers. Where motors are shared, not every set of cable
displacements can be made: with n in the left null space of T (n^T T = 0), n . (delta - s) = 0. A slack cable is longer than its
path, delta <= path, so of the paths

    n >= 0 (an antagonistic pair)     n . (path - s) >= 0, and 0 where all cables of the motor are taut
    else (cables that run together)   n . (path - s) = 0 where all are taut.

By virtual work the force at a capstan is F = T^T lambda.
"""

import functools
from collections.abc import Sequence

import numpy as np

from gravcomp.description.motor import CableMotor

_IDLE_WEIGHT = 1e-6  # of a cable without tension in the choice of the motors' displacements, over that of the one with the most


class Transmission:
    """Motors of m cables. matrix (m, k): T; preload (m,) in m: s; direct: every cable has a motor of its own, without gearing."""

    def __init__(self, motors: Sequence[CableMotor], cables: Sequence[str]):
        """motors (k), and the names of the cables (m) in their order. Raises KeyError for a cable that is not among them."""
        index = {name: i for i, name in enumerate(cables)}
        self.matrix, self.preload = np.zeros((len(cables), len(motors))), np.zeros(len(cables))
        for j, motor in enumerate(motors):
            for cable, ratio in motor.ratios.items():
                self.matrix[index[cable], j] += ratio
                if motor.pair is not None:
                    self.preload[index[cable]] += motor.preload
        self.direct = self.matrix.shape[0] == self.matrix.shape[1] and bool((self.matrix == np.eye(len(cables))).all())
        self._inverse = np.linalg.pinv(self.matrix)

    @functools.cached_property
    def first_motor(self) -> list[int]:
        """Index (m,) of the first motor of each cable."""
        return [int(np.flatnonzero(row)[0]) for row in self.matrix]

    @property
    def pays_out(self) -> np.ndarray:
        """(k,) bool: motors that only pay out when they turn back; the others pull an antagonist in."""
        return np.asarray((self.matrix >= 0.0).all(axis=0))

    def couplings(self) -> tuple[np.ndarray, np.ndarray]:
        """Return n (q, m) of the null space above, one row a coupling, and whether it is that of antagonists (q,)."""
        rows = []
        for j in range(self.matrix.shape[1]):
            cables = np.flatnonzero(self.matrix[:, j])
            alone = [i for i in cables if np.count_nonzero(self.matrix[i]) == 1]
            for other in alone[1:]:
                row = np.zeros(len(self.matrix))
                row[alone[0]], row[other] = 1.0 / self.matrix[alone[0], j], -1.0 / self.matrix[other, j]
                rows.append(row if row[alone[0]] > 0.0 else -row)
        found = np.array(rows).reshape(-1, len(self.matrix))
        return found, np.asarray((found >= 0.0).all(axis=1))

    def motors(self, displacement: Sequence[float]) -> list[float]:
        """Return the displacements (k,) in m at the capstans that come nearest to the cables' (m,)."""
        if self.direct:
            return list(displacement)
        return (self._inverse @ (np.asarray(displacement) - self.preload)).tolist()

    def cables(self, motors: Sequence[float]) -> list[float]:
        """Return the displacements (m,) in m of the cables for those at the capstans (k,)."""
        if self.direct:
            return list(motors)
        return (self.matrix @ np.asarray(motors) + self.preload).tolist()

    def velocities(self, motors: Sequence[float]) -> list[float]:
        """Return the velocities (m,) of the cables in m/s for those at the capstans (k,)."""
        return list(motors) if self.direct else (self.matrix @ np.asarray(motors)).tolist()

    def possible(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Return displacements (m,) that the motors can make, the nearer to those wanted the larger a cable's tension (m,).

        An antagonist without tension goes where the taut cable takes it.
        """
        if self.direct:
            return displacement
        root = np.sqrt(_IDLE_WEIGHT + tension / max(float(tension.max()), np.finfo(float).tiny))
        wanted = root * (displacement - self.preload)
        return self.matrix @ np.linalg.lstsq(root[:, None] * self.matrix, wanted, rcond=None)[0] + self.preload

    def forces(self, tension: Sequence[float]) -> list[float]:
        """Return the forces (k,) in N at the capstans for the tensions (m,) of the cables."""
        return list(tension) if self.direct else (self.matrix.T @ np.asarray(tension)).tolist()

    def tensions(self, force: Sequence[float]) -> list[float]:
        """Return tensions (m,) in N for the forces (k,) at the capstans.

        Of a pair the cable that the force pulls has all of it; cables that run together share it.
        """
        if self.direct:
            return [max(0.0, value) for value in force]
        result = np.zeros(len(self.matrix))
        for j, value in enumerate(force):
            column = self.matrix[:, j] * np.sign(value)
            pulled = np.maximum(column, 0.0)
            if pulled.any():
                result += abs(value) * pulled / (pulled @ pulled)
        return result.tolist()
