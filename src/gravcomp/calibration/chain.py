"""A chain of constant-curvature segments with elastic tendons, to fit tendons and frames to many poses of a slender robot.

A backbone without weight, whose tendons keep their distance r from it, bends in each segment i to a circular arc. Its bend is
the vector b_i = angle x direction in the section's plane. A tendon j, at the direction e_j, shortens by r e_j . sum_i b_i over
the segments that it passes. With the bending stiffness EI, lengths L_i, and tendons of stiffness k that only pull, the bends
minimise

    sum_i EI |b_i|^2 / (2 L_i) + k / 2 sum_j max(0, d_j - r e_j . sum_i b_i)^2,

for displacements d_j (pulled in: positive). Torsion, weight and axial compression are left out; the full model has them.
"""

import dataclasses

import numpy as np

_ROUNDS = 30  # of the search for the taut tendons


@dataclasses.dataclass(frozen=True)
class Chain:
    """length (s,) of the segments, radius of the tendons and tip (distance of the marker beyond the end) in m.

    segment (m,): the segment at whose end each tendon is fixed.
    """

    length: np.ndarray
    radius: float
    tip: float
    segment: np.ndarray

    def bends(self, displacement: np.ndarray, angle: np.ndarray, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the bends (k, s, 2) in rad for displacements (k, m) in m, and which tendons are taut (k, m).

        angle (m,) in rad of the tendons; stiffness: k / EI in 1/m^3.
        """
        s, m = len(self.length), len(self.segment)
        levers = np.zeros((m, s, 2))
        for j, last in enumerate(self.segment):
            levers[j, : last + 1] = self.radius * np.array([np.cos(angle[j]), np.sin(angle[j])])
        lever = levers.reshape(m, 2 * s)
        products = stiffness * (lever[:, :, None] * lever[:, None, :]).reshape(m, -1)
        own = np.diag(np.repeat(1.0 / self.length, 2))
        taut = np.ones(displacement.shape, dtype=bool)
        bend = np.zeros((len(displacement), 2 * s))
        for _ in range(_ROUNDS):
            matrix = (taut.astype(float) @ products).reshape(-1, 2 * s, 2 * s) + own
            load = stiffness * ((taut * displacement) @ lever)
            bend = np.linalg.solve(matrix, load[..., None])[..., 0]
            pulled = displacement - bend @ lever.T > 0.0
            if (pulled == taut).all():
                break
            taut = pulled
        return bend.reshape(-1, s, 2), taut

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


def _turn(bend: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the rotations (k, 3, 3) by `angle` about the axes perpendicular to z and to the bends (k, 2)."""
    x, y = bend.T
    one, two = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2  # sin a / a, (1 - cos a) / a^2
    turn = np.empty((len(bend), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 0, 2] = 1 - two * x * x, -two * x * y, one * x
    turn[:, 1, 0], turn[:, 1, 1], turn[:, 1, 2] = -two * x * y, 1 - two * y * y, one * y
    turn[:, 2, 0], turn[:, 2, 1], turn[:, 2, 2] = -one * x, -one * y, 1 - two * (x * x + y * y)
    return turn
