"""Gyroscope against accelerometer: unit, sign, axes and time scale of the rates.

With the right rates, the specific force turned back into the frame at the begin of a stretch of some seconds is gravity
plus linear acceleration, and the latter nearly vanishes in means over two seconds. With rates in other units or axes these
means scatter. Every signed permutation of the axes with every usual scale is tried; the one with the smallest scatter is
that of the stream. A stream of which both sensors are left-handed looks like one with all rates negated, because the cross
product in d(a)/dt = -w x a changes its sign. The bias of the rates is the mean rate at rest; before the first rest it counts as
zero, and a factor of 2 is not reported, because a bias would look like it where the sensor hardly turns.
"""

import itertools
import math

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.stream_checks.finding import Block, Finding

STRETCH = 8.0  # s
WINDOWS = 4  # of a stretch
STEP = 0.03  # s between the rotations; rates are averaged over it
LONGEST_STEP = 0.2  # s: with a longer gap a stretch is left out
LIVE_PAUSE = 16.0  # s between two stretches of a live stream
QUIET = 0.01  # largest deviation of the specific force in a block at rest, of its length: elsewhere a mean rate is no bias
ALIKE = 1.1  # ratio of scatters that says nothing
STUCK = 0.25  # s with the same rates: they are not those of the sensor, and their stretch says nothing
CERTAIN = 4.0  # standard deviations from 1 of a scale of the rates that is reported
NEAR = 0.25  # of a scale: what is fitted differs by less
CLEAR = 0.6  # ratio to the scatter of the stream as it is from which another one is right
OTHER_AXES = 0.85  # the same, to that of the right scale without a change of axes
FEWEST = 3  # stretches: one that hardly turns says nothing
LEAST = 0.005  # mean scatter of a stretch, of gravity squared, of a stream that turns too little
SCALES = {"": 1.0, "half": 0.5, "double": 2.0, "deg/s": math.pi / 180.0, "millideg/s": math.pi / 180e3}


def _candidates() -> list[tuple[np.ndarray, str]]:
    """Return matrix (3, 3) and scale of each candidate, the likelier ones first: correct, other unit, negated, other axes."""
    matrices = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            matrices.append(matrix)
    unity = np.eye(3)
    matrices.sort(key=lambda m: (not (m == unity).all(), not (m == -unity).all(), np.linalg.det(m) < 0.0, -np.trace(m)))
    return [(matrix, scale) for matrix in matrices for scale in SCALES]


CANDIDATES = _candidates()
_MATRICES = np.array([matrix * SCALES[scale] for matrix, scale in CANDIDATES])


class Axes:
    """Scatter of each candidate, summed over the stretches."""

    def __init__(self) -> None:
        self._scatter, self._stretches = np.zeros(len(CANDIDATES)), 0.0
        self._blocks: list[Block] = []
        self._length = self._pause = 0.0
        self._live = False
        self._bias, self._steadiest = np.zeros(3), math.inf  # mean rate of the quiet block in which it changes least

    def forget(self, keep: float) -> None:
        """Multiply the sums by `keep`; the stream is live, so that stretches are taken with pauses."""
        self._live = True
        self._scatter *= keep
        self._stretches *= keep

    def take(self, block: Block) -> None:
        """Take a block; every few seconds they make a stretch."""
        length = len(block.stamp_ns) * block.period
        self._find_bias(block)
        if self._pause > 0.0:
            self._pause -= length
            return
        self._blocks.append(block)
        self._length += length
        if self._length >= STRETCH:
            self._take_stretch(self._blocks)
            self._blocks, self._length = [], 0.0
            self._pause = LIVE_PAUSE if self._live else 0.0

    def findings(self) -> list[Finding]:
        """Return what is odd."""
        if self._stretches < FEWEST:
            return []
        if self._scatter.max() < LEAST * self._stretches:
            return self._of_scale()
        best, same_axes = self._likeliest(len(CANDIDATES)), self._likeliest(len(SCALES))
        if self._scatter[best] > OTHER_AXES * self._scatter[same_axes]:
            best = same_axes
        if best == 0 or self._scatter[best] > CLEAR * self._scatter[0]:
            return self._of_scale()
        matrix, scale = CANDIDATES[best]
        unit = scale if scale in ("deg/s", "millideg/s") else ""
        correction = matrix * (SCALES[unit] if unit else 1.0)
        found = []
        if (matrix == -np.eye(3)).all():
            text = "the axes are left-handed, or the signs of all rates are wrong"
            found.append(Finding("left_handed", text, gyro_matrix=correction))
        elif np.linalg.det(matrix) < 0.0:
            text = f"the axes of gyroscope and accelerometer differ in handedness: {_named(matrix)}"
            found.append(Finding("left_handed", text, gyro_matrix=correction))
        elif (matrix != np.eye(3)).any():
            text = f"gyroscope and accelerometer are in different frames: {_named(matrix)}"
            found.append(Finding("frames", text, gyro_matrix=correction))
        if unit:
            found.append(Finding("gyro_unit", f"the gyroscope is in {unit}: rad/s is needed", fatal=True, gyro_matrix=correction))
        elif scale and self._rested and self._scatter[best] <= CLEAR * self._scatter[best - list(SCALES).index(scale)]:
            found.append(_wrong_by_two(scale))
        return found

    def _of_scale(self) -> list[Finding]:
        """Return whether the rates are wrong by 2 where the sensor turns so little that linear acceleration hides most of it.

        The scatter is about a parabola over the scale s of the rates, S = c + k (s - s0)^2, and s0 the scale that fits best, with
        the variance c / (9 k n) for n stretches: each has nine differences of its means.
        """
        same, half, double = self._scatter[:3] / self._stretches  # the order of SCALES
        first = (same - half) / (1.0 - SCALES["half"])
        curvature = ((double - same) / (SCALES["double"] - 1.0) - first) / (SCALES["double"] - SCALES["half"])
        if not self._rested or not curvature > 0.0:
            return []
        fitted = 0.5 * (1.0 + SCALES["half"] - first / curvature)
        least = half + first * (fitted - SCALES["half"]) + curvature * (fitted - SCALES["half"]) * (fitted - 1.0)
        deviation = math.sqrt(max(least, 0.0) / (9.0 * curvature * self._stretches))
        if abs(fitted - 1.0) <= CERTAIN * deviation:
            return []
        return [_wrong_by_two(name) for name in ("half", "double") if abs(fitted / SCALES[name] - 1.0) < NEAR]

    @property
    def _rested(self) -> bool:
        return math.isfinite(self._steadiest)

    def _find_bias(self, block: Block) -> None:
        gyro, accel = _median(block.gyro)[1:-1], _median(block.accel)[1:-1]  # a spike at either end would remain
        steadiness = float(gyro.std(axis=0).max())
        if steadiness < self._steadiest and accel.std(axis=0).max() <= QUIET * np.linalg.norm(accel.mean(axis=0)):
            self._steadiest, self._bias = steadiness, gyro.mean(axis=0)

    def _likeliest(self, count: int) -> int:
        """Return the first of the first `count` candidates whose scatter is about the smallest of theirs."""
        scatter = self._scatter[:count]
        return int(np.argmax(scatter <= ALIKE * scatter.min()))

    def _take_stretch(self, blocks: list[Block]) -> None:
        if _longest_repeated(np.concatenate([block.gyro for block in blocks])) * blocks[-1].period > STUCK:
            return
        stamp = np.concatenate([block.stamp_ns for block in blocks])
        gyro = _median(np.concatenate([block.gyro for block in blocks]))
        accel = _median(np.concatenate([block.accel for block in blocks]))
        steps = np.diff(stamp) * 1e-9
        count = max(1, round(STEP / blocks[-1].period))
        whole = len(gyro) // (count * WINDOWS) * count * WINDOWS
        if steps.min() < 0.0 or steps.max() > LONGEST_STEP or whole < 2 * WINDOWS * count:
            return
        length = np.median(np.linalg.norm(accel, axis=1))
        if not length > 0.0:
            return
        duration = (stamp[whole - 1] - stamp[0]) * 1e-9 / (whole - 1) * count
        rate = gyro[:whole].reshape(-1, count, 3).mean(axis=1) - self._bias  # (m, 3)
        force = accel[:whole].reshape(-1, count, 3).mean(axis=1) / length
        turns = np.einsum("cij,mj->mci", _MATRICES, rate) * duration
        matrices = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(len(rate), len(CANDIDATES), 3, 3)
        orientation = np.broadcast_to(np.eye(3), (len(CANDIDATES), 3, 3))
        turned = np.empty((len(rate), len(CANDIDATES), 3))
        for m in range(len(rate)):
            orientation = orientation @ matrices[m]
            turned[m] = orientation @ force[m]
        means = turned.reshape(WINDOWS, -1, len(CANDIDATES), 3).mean(axis=1)
        self._scatter = self._scatter + np.mean(np.sum((means - means.mean(axis=0)) ** 2, axis=2), axis=0)
        self._stretches += 1.0


def _median(values: np.ndarray) -> np.ndarray:
    """Return the values (n, 3) without single spikes: the median of three neighbours."""
    inner = np.median(np.stack([values[:-2], values[1:-1], values[2:]]), axis=0)
    return np.concatenate([values[:1], inner, values[-1:]])


def _longest_repeated(values: np.ndarray) -> int:
    """Return the largest number of rows (n, 3) in a row that repeat the one before."""
    changes = np.flatnonzero(np.concatenate([[True], (values[1:] != values[:-1]).any(axis=1), [True]]))
    return int(np.diff(changes).max()) - 1


def _wrong_by_two(scale: str) -> Finding:
    text = f"the turns by the gyroscope are {'twice' if scale == 'half' else 'half'} those by the accelerometer"
    return Finding("rate", f"{text}: the sample rate or the gyroscope's scale is wrong by 2")


def _named(matrix: np.ndarray) -> str:
    """Return a signed permutation (3, 3) in words."""
    words = []
    for axis, row in zip("xyz", matrix):
        j = int(np.argmax(np.abs(row)))
        words.append(f"{axis} = {'-' if row[j] < 0 else ''}{'xyz'[j]} of the gyroscope")
    return "in the accelerometer's frame " + ", ".join(words)
