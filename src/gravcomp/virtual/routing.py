"""Ways of the tendons along the rod, and their lengths, compiled.

In a channel a tendon lies in every section at the offset d(s), which changes linearly within an element. There its length is

    l = L |v + w x d + d'|,    d: the offset at the middle of the element, d' = dd/ds

exact for a constant offset. Between two disks it is a chord, from hole to hole: l = |p_B + R_B d_B - p_A - R_A d_A|.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class Routing(NamedTuple):
    """Ways of m tendons along n elements, and q chords."""

    offset: np.ndarray  # (m, n, 3) m: place in the section, at the middle of each element
    slope: np.ndarray  # (m, n, 3): its change with the arc length
    inside: np.ndarray  # (m, n) bool: the tendon runs in a channel of this element
    start: np.ndarray  # (m,) int: first element that each tendon passes
    end: np.ndarray  # (m,) int: the element after the last one
    chord_tendon: np.ndarray  # (q,) int
    chord_from: np.ndarray  # (q,) int: cross-section A, nearer to the base
    chord_to: np.ndarray  # (q,) int: cross-section B
    hole_from: np.ndarray  # (q, 3) m: hole in A
    hole_to: np.ndarray  # (q, 3) m: hole in B

    @property
    def reach(self) -> int:
        """Largest number of elements between two cross-sections that a chord or an element connects."""
        return int(max(1, (self.chord_to - self.chord_from).max(initial=1)))


@njit(cache=True, error_model="numpy")
def tendon_lengths(
    orientation: np.ndarray,
    position: np.ndarray,
    strain: np.ndarray,
    length: np.ndarray,
    routing: Routing,
    direction: np.ndarray,
    chord: np.ndarray,
    out: np.ndarray,
) -> None:
    """Write the length of each tendon in each element to out (m, n), 0 where it does not pass.

    A chord counts in its first element. direction (m, n, 3) receives the unit vectors along the tendons in channels, in the
    section; chord (q, 4) those along the chords, in the fixed frame, and their lengths.
    """
    for c in range(out.shape[0]):
        for e in range(length.shape[0]):
            out[c, e] = 0.0
            if not routing.inside[c, e]:
                continue
            d0, d1 = routing.offset[c, e, 0], routing.offset[c, e, 1]
            x = strain[e, 0] - strain[e, 5] * d1 + routing.slope[c, e, 0]
            y = strain[e, 1] + strain[e, 5] * d0 + routing.slope[c, e, 1]
            z = strain[e, 2] + strain[e, 3] * d1 - strain[e, 4] * d0
            norm = math.sqrt(x * x + y * y + z * z)
            direction[c, e, 0], direction[c, e, 1], direction[c, e, 2] = x / norm, y / norm, z / norm
            out[c, e] = length[e] * norm
    for q in range(chord.shape[0]):
        a, b = routing.chord_from[q], routing.chord_to[q]
        total = 0.0
        for i in range(3):
            value = position[b, i] - position[a, i]
            for j in range(3):
                value += orientation[b, i, j] * routing.hole_to[q, j] - orientation[a, i, j] * routing.hole_from[q, j]
            chord[q, i] = value
            total += value * value
        chord[q, 3] = math.sqrt(total)
        for i in range(3):
            chord[q, i] /= chord[q, 3]
        out[routing.chord_tendon[q], a] = chord[q, 3]


@njit(cache=True, error_model="numpy")
def add_chords(
    orientation: np.ndarray,
    routing: Routing,
    chord: np.ndarray,
    tension: np.ndarray,
    share: np.ndarray,
    residual: np.ndarray,
    gradient: np.ndarray,
    pull: np.ndarray,
    band: np.ndarray,
) -> None:
    """Add the chords to residual, gradient, pull and band of `assemble` in forces.py.

    A chord pulls at the holes of both its cross-sections, with its tension along t:

        dl = t (dq_B - dq_A),    dq = R (dv + dw x d),    d(t) = (1 - t t^T) (dq_B - dq_A) / l
    """
    middle = band.shape[1] // 2
    unit, other = np.empty(3), np.empty(3)
    block, turned = np.empty((3, 3)), np.empty((3, 3))
    for q in range(chord.shape[0]):
        c = routing.chord_tendon[q]
        part = share[c, routing.chord_from[q]]
        here = tension[c] * part
        for side in range(2):  # rows: A, then B
            k = routing.chord_from[q] if side == 0 else routing.chord_to[q]
            hole = routing.hole_from[q] if side == 0 else routing.hole_to[q]
            sign = -1.0 if side == 0 else 1.0
            _into(orientation[k], chord[q], unit)
            pulls = (
                sign * unit[0], sign * unit[1], sign * unit[2],
                sign * hole[1] * unit[2], -sign * hole[0] * unit[2], sign * (hole[0] * unit[1] - hole[1] * unit[0]),
            )  # fmt: skip
            for i in range(6):
                residual[k, i] += here * pulls[i]
            if k == 0:
                continue
            row = 6 * (k - 1)
            for i in range(6):
                gradient[row + i, c] += pulls[i]
                pull[row + i, c] += part * pulls[i]
            if here == 0.0:
                continue
            for column_side in range(2):
                k2 = routing.chord_from[q] if column_side == 0 else routing.chord_to[q]
                if k2 == 0:
                    continue
                hole2 = routing.hole_from[q] if column_side == 0 else routing.hole_to[q]
                scale = here / chord[q, 3] * (1.0 if side == column_side else -1.0)
                _into(orientation[k2], chord[q], other)
                for i in range(3):  # R_row^T (1 - t t^T) R_column
                    for j in range(3):
                        value = -unit[i] * other[j]
                        for a in range(3):
                            value += orientation[k, a, i] * orientation[k2, a, j]
                        block[i, j] = scale * value
                for i in range(3):  # times -d^ of the column
                    turned[i, 0] = block[i, 2] * hole2[1]
                    turned[i, 1] = -block[i, 2] * hole2[0]
                    turned[i, 2] = block[i, 1] * hole2[0] - block[i, 0] * hole2[1]
                if side == column_side:  # the force turns with the section: t x dw
                    f0, f1, f2 = sign * here * unit[0], sign * here * unit[1], sign * here * unit[2]
                    turned[0, 1] -= f2
                    turned[0, 2] += f1
                    turned[1, 0] += f2
                    turned[1, 2] -= f0
                    turned[2, 0] -= f1
                    turned[2, 1] += f0
                column = 6 * (k2 - 1)
                for j in range(6):
                    x = block[0, j] if j < 3 else turned[0, j - 3]
                    y = block[1, j] if j < 3 else turned[1, j - 3]
                    z = block[2, j] if j < 3 else turned[2, j - 3]
                    shift = column + j - row + middle
                    band[row, shift] += x
                    band[row + 1, shift - 1] += y
                    band[row + 2, shift - 2] += z
                    band[row + 3, shift - 3] += hole[1] * z
                    band[row + 4, shift - 4] -= hole[0] * z
                    band[row + 5, shift - 5] += hole[0] * y - hole[1] * x


@njit(cache=True, error_model="numpy", inline="always")
def _into(orientation: np.ndarray, vector: np.ndarray, out: np.ndarray) -> None:
    """Write R^T vector[:3] to out (3,)."""
    for i in range(3):
        out[i] = orientation[0, i] * vector[0] + orientation[1, i] * vector[1] + orientation[2, i] * vector[2]
