"""Gyroscope against accelerometer: unit, sign, axes and time scale of the rates.

With the right rates, the specific force turned back into the frame at the begin of a stretch of some seconds is gravity
plus linear acceleration, and the latter nearly vanishes in means over two seconds. With rates in other units or axes these
means scatter. Every signed permutation of the axes with every usual scale is tried; the one with the smallest scatter is
that of the stream. A stream of which both sensors are left-handed looks like one with all rates negated, because the cross
product in d(a)/dt = -w x a changes its sign. The scale of the rates: `rate_scale`.
"""

import itertools
import math

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.stream_checks.finding import Block, Finding
from gravcomp.stream_checks.rate_scale import RATE_SCALES, RateScale, chance_square
from gravcomp.stream_checks.resting import LARGEST_BIAS, QUIET, STEADY

STRETCH = 8.0  # s
WINDOWS = 4  # of a stretch
STEP = 0.03  # s between the rotations; rates are averaged over it
LONGEST_STEP = 0.2  # s: with a longer gap a stretch is left out
LIVE_PAUSE = 16.0  # s between two stretches of a live stream
REST = 0.5  # s of rest in which the mean rate is the bias
ALIKE = 1.1  # ratio of scatters that says nothing
SPIKE = 6.0  # of the usual distance of a sample from the median of its neighbours
STUCK = 0.25  # s with the same rates: they are not those of the sensor, and their stretch says nothing
CLEAR = 0.6  # ratio to the scatter of the stream as it is from which another one is right
FAR = 10.0  # ratio to the scatter without turns of rates in another unit
RANDOM = 0.1  # mean scatter of a stretch, of gravity squared, at least with rates in another unit
OTHER_AXES = 0.85  # the same, to that of the right scale without a change of axes
FEWEST = 3  # stretches: one that hardly turns says nothing
LEAST = 0.005  # mean scatter of a stretch, of gravity squared, of a stream that turns too little
STILL = 0.01  # deviation of the means of a stretch by changes of the velocity at least, of gravity: weighs the stretches
UNCALIBRATED = 0.15  # m/s^2
LARGEST = 0.2 * STANDARD_GRAVITY  # m/s^2
EXPLAINED = 40.0  # ratio of what an offset and a scale explain to the variance that is left
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
_MATRICES = np.array([matrix for matrix, _ in CANDIDATES[:: len(SCALES)]])
_NEGATED = (np.linalg.det(_MATRICES) < 0.0).astype(int)
# Factors of the rates: those of the candidates and negated, those of the rate's scale, and the one without turns.
_SIGNED = 2 * len(SCALES)
_FACTORS = np.array([sign * scale for scale in SCALES.values() for sign in (1.0, -1.0)] + [*RATE_SCALES.values(), 0.0])
_UNITS = (1.0, math.pi / 180.0, math.pi / 180e3)  # rad/s in the units that the rates may have
# The unit of each factor, as its number in _UNITS.
_UNIT = np.array([_UNITS.index(abs(f)) if abs(f) in _UNITS else 0 for f in _FACTORS])


class Axes:
    """Scatter of each candidate, summed over the stretches."""

    def __init__(self) -> None:
        self._scatter = np.zeros(len(CANDIDATES) + 1)  # weighted; the last one without turns
        self._stretches = self._turning = self._as_given = 0.0
        self._rate = RateScale()
        self._windows: list[list[float]] = []  # length of gravity in m/s^2, and mean direction in the sensor's frame
        self._blocks: list[Block] = []
        self._length = self._pause = 0.0
        self._live = False
        self._biases: list[np.ndarray | None] = [None] * len(_UNITS)  # of the last rest that it is in each of the units

    def forget(self, keep: float) -> None:
        """Multiply the sums by `keep`; the stream is live, so that stretches are taken with pauses."""
        self._live = True
        self._scatter *= keep
        self._stretches *= keep
        self._turning *= keep
        self._as_given *= keep
        self._rate.forget(keep)
        self._windows = self._windows[-10 * WINDOWS :]

    def take(self, block: Block) -> None:
        """Take a block; every few seconds they make a stretch."""
        length = len(block.stamp_ns) * block.period
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
        if self._stretches < FEWEST or not self._turns:
            return self._rate.findings() or self._of_length()
        scatter, still = self._scatter[:-1], self._scatter[-1]
        best, same_axes = self._likeliest(len(CANDIDATES)), self._likeliest(len(SCALES))
        likelier = self._likelier
        if scatter[best] > min(OTHER_AXES, likelier) * min(scatter[same_axes], self._rate.scatter):
            best = same_axes
        matrix, scale = CANDIDATES[best]
        usual = best < len(SCALES) and scale in ("", "half", "double")
        # Rates in another unit turn gravity about at random, those of other axes at most twice as far as it turns.
        at_random = scatter[0] > FAR * still and self._as_given > RANDOM * self._stretches
        shown = scatter[best] <= likelier * still or (scale.endswith("deg/s") and at_random)
        if scatter[best] <= CLEAR * scatter[0] and not usual and not shown and CLEAR * scatter[0] > still:
            text = "the rates contradict the accelerometer: axes, signs or unit are wrong; it turns too little to show which"
            return [Finding("contradiction", text)]
        if usual or not shown or scatter[best] > CLEAR * scatter[0]:
            return self._rate.findings() or self._of_length()
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
        return found

    def unknown(self) -> list[str]:
        """Return what the motion does not show, a sentence each."""
        axes = []
        if self._stretches < FEWEST:
            axes = [f"the stream is too short to check unit and axes of the gyroscope: {FEWEST * STRETCH:.0f} s are needed"]
        elif not self._turns:
            axes = ["the sensor turns too little to check unit and axes of the gyroscope"]
        return [*axes, *self._rate.unknown()]

    @property
    def _turns(self) -> bool:
        return self._turning >= LEAST * self._stretches

    @property
    def _likelier(self) -> float:
        """The ratio of scatters below which a candidate is not the better one by chance."""
        degrees = 3.0 * (WINDOWS - 1.0) * self._stretches
        return 1.0 / (1.0 + chance_square(degrees, len(CANDIDATES)) / degrees)

    def _of_length(self) -> list[Finding]:
        """Return whether gravity has another length in the means over the windows, by a scale and an offset.

        A sensor with offset o that points up along d (in its own frame) measures the length g + o d.
        """
        if len(self._windows) < FEWEST * WINDOWS:
            return []
        windows = np.array(self._windows)  # (n, 4): length in m/s^2, direction
        error = windows[:, 0] - STANDARD_GRAVITY
        by_direction = np.column_stack([np.ones(len(windows)), windows[:, 1:]])
        fitted = by_direction @ np.linalg.lstsq(by_direction, error, rcond=1e-2)[0]
        left = float(np.sum((error - fitted) ** 2))
        gain = float(np.sum(error**2)) - left
        size = math.sqrt(float(np.mean(fitted**2)))
        # Of the windows, whose errors go together, as many count as there are stretches.
        if not UNCALIBRATED < size < LARGEST or gain * (len(windows) - 4.0) < EXPLAINED * WINDOWS * left:
            return []
        text = f"in motion gravity is wrong by {size:.2f} m/s^2: scale or offset of the accelerometer; calibrate"
        return [Finding("accel_calibration", text)]

    def _likeliest(self, count: int) -> int:
        """Return the first of the first `count` candidates whose scatter is about the smallest of theirs."""
        scatter = self._scatter[:count]
        return int(np.argmax(scatter <= ALIKE * scatter.min()))

    def _find_biases(self, gyro: np.ndarray, accel: np.ndarray, period: float) -> None:
        """Take the mean rate of the steadiest rest in each unit, if there is one, among means (m, 3) over `period` s."""
        count = max(4, round(REST / period))
        whole = len(gyro) // count * count
        if not whole:
            return
        rates, forces = (values[:whole].reshape(-1, count, 3) for values in (gyro, accel))
        deviation = rates.std(axis=1).max(axis=1)
        quiet = forces.std(axis=1).max(axis=1) <= QUIET * np.linalg.norm(forces.mean(axis=1), axis=1)
        for number, unit in enumerate(_UNITS):
            still = quiet & (unit * np.abs(rates.mean(axis=1)).max(axis=1) <= LARGEST_BIAS)
            steady = np.where(still, deviation, np.inf)
            if unit * steady.min() <= STEADY:
                self._biases[number] = rates[int(np.argmin(steady))].mean(axis=0)

    def _take_stretch(self, blocks: list[Block]) -> None:
        stamp = np.concatenate([block.stamp_ns for block in blocks])
        order = np.argsort(stamp, kind="stable")
        stamp, gyro = stamp[order], np.concatenate([block.gyro for block in blocks])[order]
        accel = _median(np.concatenate([block.accel for block in blocks])[order])
        if _stuck(gyro, accel, round(STUCK / blocks[-1].period)):
            return
        gyro = _without_spikes(gyro)
        steps = np.diff(stamp) * 1e-9
        count = max(1, round(STEP / blocks[-1].period))
        whole = len(gyro) // (count * WINDOWS) * count * WINDOWS
        if steps.max() > max(LONGEST_STEP, 3.0 * blocks[-1].period) or whole < 2 * WINDOWS * count:
            return
        length = np.median(np.linalg.norm(accel, axis=1))
        if not length > 0.0:
            return
        duration = (stamp[whole - 1] - stamp[0]) * 1e-9 / (whole - 1) * count
        rate = gyro[:whole].reshape(-1, count, 3).mean(axis=1)  # (m, 3)
        force = accel[:whole].reshape(-1, count, 3).mean(axis=1) / length
        self._find_biases(rate, force, duration)
        biases = np.array([np.zeros(3) if bias is None else bias for bias in self._biases])
        turns = _FACTORS[:, None] * (rate[:, None] - biases[_UNIT]) * duration
        matrices = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(len(rate), len(_FACTORS), 3, 3)
        orientations = np.empty_like(matrices)
        orientation = np.broadcast_to(np.eye(3), (len(_FACTORS), 3, 3))
        for m in range(len(rate)):
            orientation = orientations[m] = orientation @ matrices[m]
        parts = _mean_parts(orientations, force)
        means = np.trace(parts, axis1=3, axis2=4)  # of the turned force
        candidates, scatter, scales = _scatter_of_candidates(parts), _scatter(means), slice(_SIGNED, -1)
        turned = (orientations[:, scales] @ force[:, None, :, None])[..., 0]
        weight = 1.0 / (STILL**2 + min(candidates[: len(SCALES)].min(), scatter[scales].min()))
        self._scatter = self._scatter + weight * np.append(candidates, scatter[-1])
        self._turning += candidates.max()
        self._as_given += candidates[0]
        self._stretches += 1.0
        self._rate.take(orientations[:, scales] * duration, turned, weight, WINDOWS, rested=self._biases[0] is not None)
        up = np.einsum("mji,wj->wmi", orientations[:, 0], means[:, 0]).reshape(WINDOWS, WINDOWS, -1, 3)
        lengths = np.linalg.norm(means[:, 0], axis=1)
        directions = up[range(WINDOWS), range(WINDOWS)].mean(axis=1) / lengths[:, None]
        self._windows += np.column_stack([length * lengths, directions]).tolist()


def _mean_parts(orientations: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the means (w, f, 3, 3, 3) over the windows of R_rj a_i, for orientations R (m, f, 3, 3) and the force a (m, 3)."""
    inside = len(force) // WINDOWS
    entries = orientations.reshape(WINDOWS, inside, -1).swapaxes(1, 2)
    return (entries @ force.reshape(WINDOWS, inside, 3) / inside).reshape(WINDOWS, -1, 3, 3, 3)


def _scatter_of_candidates(parts: np.ndarray) -> np.ndarray:
    """Return the scatter of each of the CANDIDATES from the `_mean_parts` of all factors.

    With rates P w the orientation is P R P^T, where R is that by the rates w, negated where det P is: a signed permutation of
    the axes turns or mirrors all rotations alike. So the force turned back is P R P^T a, whose scatter is that of R P^T a.
    """
    means = parts[:, :_SIGNED].swapaxes(3, 4).reshape(WINDOWS, _SIGNED, 3, 9) @ _MATRICES.reshape(-1, 9).T
    scatter = _scatter(means.swapaxes(2, 3)).reshape(len(SCALES), 2, -1)
    return scatter[:, _NEGATED, np.arange(len(_MATRICES))].T.ravel()


def _scatter(means: np.ndarray) -> np.ndarray:
    """Return the scatter (...,) of the means (w, ..., 3) of the windows about their mean."""
    return np.mean(np.sum((means - means.mean(axis=0)) ** 2, axis=-1), axis=0)


def _median(values: np.ndarray) -> np.ndarray:
    """Return the values (n, 3) without single spikes: the median of three neighbours."""
    return np.concatenate([values[:1], _middle(values[:-2], values[1:-1], values[2:]), values[-1:]])


def _middle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the median of three values each, which a few comparisons find faster than a sort."""
    return np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))


def _without_spikes(values: np.ndarray) -> np.ndarray:
    """Return the values (n, 3) without spikes of one or two samples: the median of five neighbours stands in for them."""
    padded = np.pad(values, ((2, 2), (0, 0)), mode="edge")
    a, b, d, e = padded[:-4], padded[1:-3], padded[3:-1], padded[4:]
    low, high = np.maximum(np.minimum(a, b), np.minimum(d, e)), np.minimum(np.maximum(a, b), np.maximum(d, e))
    middle = _middle(low, high, values)  # of five
    away = np.abs(values - middle)
    return np.where(away > SPIKE * np.median(away, axis=0), middle, _median(values))


def _stuck(gyro: np.ndarray, accel: np.ndarray, longest: int) -> bool:
    """Return whether rates (n, 3) repeat for more than `longest` samples while the specific force (n, 3) changes."""
    changes = np.flatnonzero(np.concatenate([[True], (gyro[1:] != gyro[:-1]).any(axis=1), [True]]))
    for i in np.flatnonzero(np.diff(changes) > longest):
        forces = accel[changes[i] : changes[i + 1]]
        if forces.std(axis=0).max() > QUIET * np.linalg.norm(forces.mean(axis=0)):
            return True
    return False


def _named(matrix: np.ndarray) -> str:
    """Return a signed permutation (3, 3) in words."""
    words = []
    for axis, row in zip("xyz", matrix):
        j = int(np.argmax(np.abs(row)))
        words.append(f"{axis} = {'-' if row[j] < 0 else ''}{'xyz'[j]} of the gyroscope")
    return "in the accelerometer's frame " + ", ".join(words)
