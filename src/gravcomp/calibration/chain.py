"""A chain of constant-curvature segments with elastic tendons, to fit tendons and frames to many poses of a slender robot.

A backbone without weight, whose tendons keep their distance r from it, bends in each segment i to a circular arc. Its bend is
the vector b_i = angle x direction in the section's plane. A tendon j, at the direction e_j, shortens over the segments that it
passes by

    l_j = sum_i r e_j . b_i + c |b_i|^2.

The second part is that of tendons that run straight from disk to disk: the chord of each of n gaps is shorter than its arc,
whose angle is |b_i| / n, so that c = L_i / (24 n^2) (P. Rao et al., Frontiers in Robotics and AI, 2021, section 2). With the
bending stiffness EI, lengths L_i, tendons of stiffness k that only pull, and displacements d_j (pulled in: positive), the bends
are where

    b_i / L_i - (k / EI) sum_j max(0, d_j - l_j) dl_j / db_i + f_i = 0

for moments f_i of friction, over EI. Torsion, weight and axial compression are left out; the full model has them.
"""

import dataclasses

import numpy as np

_ROUNDS = 40  # of the search for the equilibria
_DAMPED = 12, 25  # rounds from which a search that goes round takes half and quarter steps
_LONGEST = 0.5  # rad, of a step
_EXACT = 1e-6  # rad
_SOFTEST = 0.3  # of the backbone's stiffness: what the slope keeps where long tendons would make it unstable


@dataclasses.dataclass(frozen=True)
class Chain:
    """length (s,) of the segments, radius of the tendons and tip (distance of the marker beyond the end) in m.

    segment (m,): the segment at whose end each tendon is fixed; shortening: c in m.
    """

    length: np.ndarray
    radius: float
    tip: float
    segment: np.ndarray
    shortening: float = 0.0

    def bends(
        self,
        displacement: np.ndarray,
        angle: np.ndarray,
        stiffness: float,
        friction: np.ndarray | float = 0.0,
        start: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the bends (k, s, 2) in rad for displacements (k, m) in m, and which tendons are taut (k, m).

        angle (m,) in rad of the tendons; stiffness: k / EI in 1/m^3; friction (k, s, 2) in 1/m; start (k, s, 2): where the
        search begins, the straight chain by default.
        """
        shape = (len(displacement), len(self.length), 2)
        bends = np.zeros(shape) if start is None else start.copy()
        moment = np.broadcast_to(friction, shape)
        open_rows = np.arange(len(bends))
        for number in range(_ROUNDS):
            unbalanced, slope = self.unbalanced(bends[open_rows], displacement[open_rows], angle, stiffness, moment[open_rows])
            step = np.linalg.solve(slope, unbalanced.reshape(len(open_rows), -1, 1))[..., 0]
            largest = np.abs(step).max(axis=1, initial=0.0)
            share = np.minimum(1.0, _LONGEST / np.maximum(largest, _EXACT)) * 0.5 ** sum(number >= late for late in _DAMPED)
            bends[open_rows] -= (share[:, None] * step).reshape(-1, *shape[1:])
            open_rows = open_rows[largest > _EXACT]
            if not len(open_rows):
                break
        return bends, displacement > self._shortened(bends, angle)

    def unbalanced(
        self, bends: np.ndarray, displacement: np.ndarray, angle: np.ndarray, stiffness: float, friction: np.ndarray | float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the left side (k, s, 2) of the equilibrium in 1/m at given bends, and its slope (k, 2 s, 2 s) by the bends."""
        number, s, _ = bends.shape
        stretch = displacement - self._shortened(bends, angle)
        force = stiffness * np.maximum(stretch, 0.0)
        passed = self._passed()
        along = force @ passed  # (k, s): what all tendons in a segment pull together
        own = np.repeat(1.0 / self.length, 2)
        lever = self._levers(angle)
        left = bends / self.length[:, None] - (force @ lever.reshape(-1, 2 * s)).reshape(bends.shape)
        left += friction - 2.0 * self.shortening * bends * along[:, :, None]
        arm = lever[None] + 2.0 * self.shortening * bends[:, None] * passed[None, :, :, None]
        arm = (arm * np.sqrt(stiffness) * (stretch > 0.0)[:, :, None, None]).reshape(number, -1, 2 * s)
        slope = arm.transpose(0, 2, 1) @ arm
        diagonal = np.arange(2 * s)
        slope[:, diagonal, diagonal] += np.maximum(own - 2.0 * self.shortening * np.repeat(along, 2, axis=1), _SOFTEST * own)
        return left, slope

    def tips(self, bends: np.ndarray) -> np.ndarray:
        """Return the marker (k, 3) in m for bends (k, s, 2), in the frame of the base, whose z is the straight chain."""
        position = np.zeros((len(bends), 3))
        frame = np.tile(np.eye(3), (len(bends), 1, 1))
        for length, bend in zip(self.length, bends.transpose(1, 0, 2)):
            angle = np.linalg.norm(bend, axis=1)
            aside = length * 0.5 * bend * (np.sinc(angle / (2 * np.pi)) ** 2)[:, None]  # L (1 - cos a) / a, towards the bend
            local = np.column_stack([aside, length * np.sinc(angle / np.pi)])
            position += np.einsum("kij,kj->ki", frame, local)
            frame = frame @ _turn(bend, angle)
        return position + self.tip * frame[:, :, 2]

    def _passed(self) -> np.ndarray:
        """Return which segments each tendon passes, as ones and zeros (m, s)."""
        return (np.arange(len(self.length)) <= self.segment[:, None]).astype(float)

    def _levers(self, angle: np.ndarray) -> np.ndarray:
        """Return r e_j of each tendon in the segments that it passes (m, s, 2)."""
        return self._passed()[:, :, None] * self.radius * np.column_stack([np.cos(angle), np.sin(angle)])[:, None]

    def _shortened(self, bends: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Return by how much the tendons' paths shorten (k, m) in m."""
        count = 2 * len(self.length)
        along = bends.reshape(-1, count) @ self._levers(angle).reshape(-1, count).T
        return np.asarray(along + self.shortening * (bends**2).sum(axis=2) @ self._passed().T)


def _turn(bend: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the rotations (k, 3, 3) by `angle` about the axes perpendicular to z and to the bends (k, 2)."""
    x, y = bend.T
    one, two = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2  # sin a / a, (1 - cos a) / a^2
    turn = np.empty((len(bend), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 0, 2] = 1 - two * x * x, -two * x * y, one * x
    turn[:, 1, 0], turn[:, 1, 1], turn[:, 1, 2] = -two * x * y, 1 - two * y * y, one * y
    turn[:, 2, 0], turn[:, 2, 1], turn[:, 2, 2] = -one * x, -one * y, 1 - two * (x * x + y * y)
    return turn
