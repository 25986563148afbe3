"""Quiet times: the length of the specific force there gives unit and calibration, the mean rate the drift of the bias."""

import math

import numpy as np

from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.stream_checks.finding import Block, Finding

WINDOW = 0.5  # s
FINEST = 0.01  # s: samples of a faster stream are averaged, because a single one has more noise the higher the rate is
QUIET = 0.01  # largest deviation of a specific force in a quiet window, of its length
STEADY = math.radians(0.5)  # rad/s, largest deviation of a rate in it
LARGEST_BIAS = math.radians(5.0)  # rad/s: a larger mean rate is rotation
UNIT = 0.2  # relative error of the length that a bad calibration explains
MOVING = 2.0  # ratio of lengths that motion explains
STEADY_LENGTH = 0.7  # lowest tenth of the lengths in motion over their median: with gravity 0.8 and more, without it 0.4 to 0.6
UNCALIBRATED = 0.1  # m/s^2
DRIFT = math.radians(0.15)  # rad/s
TOGETHER = 5  # windows of which a mean rate is taken
MEANS = 3  # at least, from which the bias drifts
KEPT = 400  # windows
UNITS = {"g": 1.0, "milli-g": 1000.0, "cm/s^2": 100.0 * STANDARD_GRAVITY}  # length of gravity in units that are not m/s^2
UPSIDE_DOWN = math.cos(math.radians(15.0))


class Resting:
    """Means of the quiet windows."""

    def __init__(self) -> None:
        self._norms: list[float] = []  # of all windows, quiet or not
        self._quiet: list[np.ndarray] = []  # mean specific force
        self._bias: list[np.ndarray] = []  # mean rate, the first ones and the last ones

    def forget(self, keep: float) -> None:
        """Keep the newest windows only."""
        self._norms, self._quiet = self._norms[-KEPT:], self._quiet[-KEPT:]
        self._bias = self._bias[:10] + self._bias[10:][-KEPT:]

    def take(self, block: Block) -> None:
        """Look at the windows of a block."""
        averaged = max(1, round(FINEST / block.period))
        accel, gyro = (_averaged(values, averaged) for values in (block.accel, block.gyro))
        count = max(4, round(WINDOW / (averaged * block.period)))
        whole = len(accel) // count * count
        forces, rates = (values[:whole].reshape(-1, count, 3) for values in (accel, gyro))
        norms = np.linalg.norm(forces.mean(axis=1), axis=1)
        quiet = forces.std(axis=1).max(axis=1, initial=0.0) <= QUIET * np.maximum(norms, 0.3)
        still = rates.std(axis=1).max(axis=1, initial=0.0) <= STEADY
        still &= np.abs(rates.mean(axis=1)).max(axis=1, initial=0.0) <= LARGEST_BIAS
        self._norms += norms.tolist()
        self._quiet += list(forces[quiet].mean(axis=1))
        self._bias += list(rates[quiet & still].mean(axis=1))

    def findings(self) -> list[Finding]:
        """Return what is odd."""
        return [*self._of_length(), *self._of_bias()]

    @property
    def starts_upside_down(self) -> bool:
        """Whether the specific force of the first quiet window points along -z."""
        first = self._quiet[0] if self._quiet else np.zeros(3)
        return bool(-first[2] > UPSIDE_DOWN * np.linalg.norm(first) > 0.0)

    def _of_length(self) -> list[Finding]:
        rested = len(self._quiet) >= 3
        norms = np.linalg.norm(self._quiet, axis=1) if rested else np.array(self._norms)
        if len(norms) < 3:
            return []
        length = float(np.median(norms))
        if abs(length / STANDARD_GRAVITY - 1.0) <= UNIT:
            error = float(np.mean(np.abs(norms - STANDARD_GRAVITY)))
            if not rested or error <= UNCALIBRATED:
                return []
            text = f"the specific force at rest is {length:.2f} m/s^2: scale or offset of the accelerometer; calibrate"
            return [Finding("accel_calibration", text)]
        if not rested and 1.0 / MOVING < length / STANDARD_GRAVITY < MOVING:
            return []
        where = "at rest" if rested else "in motion"
        if not rested and np.quantile(norms, 0.1) < STEADY_LENGTH * length:
            text = f"the specific force {where} varies about {length:.3g} as without gravity: gravity was removed"
            return [Finding("no_gravity", text, fatal=True)]
        name, unit = min(UNITS.items(), key=lambda item: abs(math.log(max(length, 1e-12) / item[1])))
        if abs(length / unit - 1.0) <= UNIT or (not rested and 1.0 / MOVING < length / unit < MOVING):
            text = f"the accelerometer is in {name} ({length:.3g} {where}): m/s^2 is needed"
            return [Finding("accel_unit", text, fatal=True, accel_factor=STANDARD_GRAVITY / unit)]
        if length < 0.05 * STANDARD_GRAVITY:
            return [Finding("no_gravity", f"the specific force {where} is {length:.2f}: gravity was removed", fatal=True)]
        text = f"the accelerometer is in no known unit: {length:.3g} {where}, 9.81 m/s^2 is needed"
        return [Finding("accel_unit", text, fatal=True)]

    def _of_bias(self) -> list[Finding]:
        count = len(self._bias) // TOGETHER
        if count < MEANS:
            return []
        means = np.array(self._bias[: count * TOGETHER]).reshape(count, TOGETHER, 3).mean(axis=1)
        drift = float(np.abs(means - means[0]).max())
        if drift <= DRIFT:
            return []
        return [Finding("bias_drift", f"the bias of the gyroscope drifts by {math.degrees(drift):.2f} deg/s: it follows at rest")]


def _averaged(values: np.ndarray, count: int) -> np.ndarray:
    """Return the means (n // count, 3) of every `count` values (n, 3)."""
    return values[: len(values) // count * count].reshape(-1, count, 3).mean(axis=1)
