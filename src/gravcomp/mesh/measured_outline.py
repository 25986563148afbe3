"""A closed curve in a cross-section that is known by its corners, as the section of a surface is."""

import functools
import math

import numpy as np

# A corner of the curve turns by this angle (rad) within this part of the curve's length to each side; the rest is smooth.
_TURN, _WITHIN = math.radians(65.0), 0.025
_QUARTER = math.pi / 2


class MeasuredOutline:
    """A curve that every ray from its middle meets once.

    Attributes: x, y: its middle, the centroid of what it encloses (m); half_width, half_height (m): half of its size along x and
    y. The parameter of `boundary` grows with the area that a ray from the middle sweeps, which on an ellipse is the eccentric
    angle and on a straight side grows evenly; it is 0 on the ray along x. On a curve with slots (`with_slots`) it is an odd
    multiple of 45 deg at these, as at the corners of a rectangular `Outline`.
    """

    def __init__(self, corners: np.ndarray):
        """corners (n, 2): in order, counterclockwise. Raises ValueError for a curve that a ray from its middle meets twice."""
        after = np.roll(corners, -1, axis=0)
        cross = corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]
        middle = ((corners + after) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
        place = corners - middle
        place = np.roll(place, -int(np.argmin(np.arctan2(place[:, 1], place[:, 0]))), axis=0)
        self._place = np.vstack([place, place[:1]])
        self._polar = np.unwrap(np.arctan2(self._place[:, 1], self._place[:, 0]))
        if (np.diff(self._polar) <= 0.0).any():
            raise ValueError("a ray from its middle meets it more than once")
        self.x, self.y = float(middle[0]), float(middle[1])
        a, b = self._place[:-1], self._place[1:]
        self._swept = np.concatenate([[0.0], np.cumsum(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))])
        self._slots: np.ndarray | None = None
        self.half_width, self.half_height = (float(np.ptp(self._place[:, i])) / 2 for i in range(2))

    @property
    def shape(self) -> str:
        """'ellipse' for a smooth curve, 'slots' for one with places for nodes."""
        return "ellipse" if self._slots is None else "slots"

    def with_slots(self, slots: np.ndarray | None) -> "MeasuredOutline":
        """Return the curve with four polar angles (4,), ascending, whose points have odd multiples of 45 deg as parameters."""
        other = object.__new__(MeasuredOutline)
        other.__dict__.update(self.__dict__)
        other._slots = slots
        return other

    def boundary(self, angle: np.ndarray) -> np.ndarray:
        """Return points (k, 2) for the parameters `angle` (k,), in rad."""
        angle, whole = np.asarray(angle, dtype=float), self._swept[-1]
        if self._slots is None:
            swept = self._swept_at(np.zeros(1)) + angle / (2 * math.pi) * whole
        else:
            at = self._swept_at(self._slots)
            at = np.append(at[0] + np.mod(at - at[0], whole), at[0] + whole)
            turns = (angle - _QUARTER / 2) / _QUARTER
            slot = np.floor(turns + 1e-9)
            part, slot = turns - slot, slot.astype(int) % 4
            swept = at[slot] + part * (at[slot + 1] - at[slot])
        return np.array([self.x, self.y]) + self._after(swept)

    def square(self, angle: np.ndarray) -> np.ndarray:
        """Return points (k, 2), seen from the middle, on the quadrilateral through the curve's points at 45, 135, ... deg."""
        corners = self.boundary(_QUARTER * (np.arange(5) + 0.5)) - [self.x, self.y]
        turns = np.mod((np.asarray(angle, dtype=float) - _QUARTER / 2) / _QUARTER, 4.0)
        return np.stack([np.interp(turns, np.arange(5), corners[:, i]) for i in range(2)], axis=-1)

    def stood_out(self, angle: np.ndarray) -> "MeasuredOutline":
        """Return the curve so much larger that parabolas through its points enclose its polar second moment of area.

        angle (2 k,): the parameters of the points, those in the middle of a facet at odd places.
        """
        points = self.boundary(angle) - [self.x, self.y]
        first, middle, last = points[::2], points[1::2], np.roll(points[::2], -1, axis=0)
        t, weight = np.polynomial.legendre.leggauss(4)
        shape = np.stack([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2])
        slope = np.stack([t - 0.5, -2 * t, t + 0.5])
        at, by = (np.einsum("nq,nki->kqi", values, np.stack([first, middle, last])) for values in (shape, slope))
        polar = 0.25 * float((((at**2).sum(axis=2)) * (at[..., 0] * by[..., 1] - at[..., 1] * by[..., 0]) @ weight).sum())
        a, b = self._place[:-1], self._place[1:]
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        wanted = float(cross @ (a * a + a * b + b * b).sum(axis=1)) / 12.0
        factor = (wanted / polar) ** 0.25
        other = self.with_slots(self._slots)
        other._place, other._swept = factor * self._place, factor**2 * self._swept
        other.half_width, other.half_height = factor * self.half_width, factor * self.half_height
        return other

    @functools.cached_property
    def corners(self) -> np.ndarray:
        """The polar angles (k,) in rad, ascending, at which the curve turns sharply."""
        along, turn = self._along_and_turn
        length, count = along[-1], len(turn)
        reach = _WITHIN * length
        place = np.concatenate([along[:-1] + k * length for k in (-1, 0, 1)])
        turned = np.concatenate([[0.0], np.cumsum(np.tile(turn, 3))])
        low, high = (np.searchsorted(place, along[:-1] + side) for side in (-reach, reach))
        total = turned[high] - turned[low]
        sharp = np.flatnonzero(total >= _TURN)
        found: list[float] = []  # along the curve; of the places near each other the one in the middle of the turn
        for index in sharp[np.argsort(-total[sharp], kind="stable")]:
            near = np.arange(low[index], high[index])
            share = np.maximum(turn[near % count], 0.0)
            at = float(share @ place[near] / share.sum())
            if all(abs(math.remainder(at - other, length)) > 2.0 * reach for other in found):
                found.append(at)
        points = [np.interp(np.mod(found, length), along, self._place[:, i]) for i in range(2)]
        return np.sort(np.arctan2(points[1], points[0]))

    def four_slots(self) -> np.ndarray:
        """Return four polar angles (4,) in rad, ascending: its corners, of which it has four at most, and others between them.

        These divide the smooth parts evenly by how much they turn: none lies on a straight side, where it would make a flat cell.
        """
        along, turn = self._along_and_turn
        length = along[-1]
        polar = np.sort(np.mod(self.corners, 2 * math.pi))
        at = np.array([self._length_at(value) for value in polar])
        ends = np.append(at, at[0] + length)
        place = np.concatenate([along[:-1], along[:-1] + length])
        smooth = np.tile(np.maximum(turn, 0.0), 2)
        near = np.abs(np.remainder(place[:, None] - at + length / 2, length) - length / 2).min(axis=1) <= 1.5 * _WITHIN * length
        turned = np.cumsum(np.where(near, 0.0, smooth))
        between = np.array([_passed(place, turned, high) - _passed(place, turned, low) for low, high in zip(ends, ends[1:])])
        number = np.zeros(len(at), dtype=int)
        for _ in range(4 - len(at)):
            number[np.argmax(between / (number + 1))] += 1
        for low, whole, count in zip(ends, between, number):
            wanted = _passed(place, turned, low) + whole * np.arange(1, count + 1) / (count + 1)
            at = np.append(at, place[np.minimum(np.searchsorted(turned, wanted), len(place) - 1)])
        points = [np.interp(np.mod(at, length), along, self._place[:, i]) for i in range(2)]
        return np.sort(np.mod(np.arctan2(points[1], points[0]), 2 * math.pi))

    @functools.cached_property
    def _along_and_turn(self) -> tuple[np.ndarray, np.ndarray]:
        """Lengths (n + 1,) along the curve at its corners, and the angle (n,) in rad by which it turns at each."""
        step = np.diff(self._place, axis=0)
        heading = np.arctan2(step[:, 1], step[:, 0])
        turn = np.mod(heading - np.roll(heading, 1) + math.pi, 2 * math.pi) - math.pi
        return np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))]), turn

    def _length_at(self, polar: float) -> float:
        """Length along the curve, from its first corner, of its point at a polar angle."""
        along, _ = self._along_and_turn
        swept = float(self._swept_at(np.array([polar]))[0])
        return float(np.interp(swept, self._swept, along))

    def _swept_at(self, polar: np.ndarray) -> np.ndarray:
        """Areas (k,) in m^2 swept from the first corner to the polar angles (k,)."""
        wrapped = self._polar[0] + np.mod(polar - self._polar[0], 2 * math.pi)
        edge = np.clip(np.searchsorted(self._polar, wrapped, side="right") - 1, 0, len(self._polar) - 2)
        a, b = self._place[edge], self._place[edge + 1]
        x, y = np.cos(wrapped), np.sin(wrapped)
        off_a, off_b = a[:, 0] * y - a[:, 1] * x, b[:, 0] * y - b[:, 1] * x
        part = np.clip(off_a / (off_a - off_b), 0.0, 1.0)
        return np.asarray(self._swept[edge] + part * (self._swept[edge + 1] - self._swept[edge]))

    def _after(self, swept: np.ndarray) -> np.ndarray:
        """Points (k, 2), seen from the middle, at which rays have swept these areas (k,) from the first corner."""
        within = np.mod(swept, self._swept[-1])
        return np.stack([np.interp(within, self._swept, self._place[:, i]) for i in range(2)], axis=-1)


def _passed(place: np.ndarray, turned: np.ndarray, at: float) -> float:
    """What a curve has turned (rad) up to `at`, from the sums at its places."""
    index = int(np.searchsorted(place, at, side="right")) - 1
    return float(turned[index]) if index >= 0 else 0.0
