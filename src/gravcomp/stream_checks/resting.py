"""Quiet times: the length of the specific force there gives unit and calibration, the mean rate the drift of the bias."""

import math

import numpy as np

from gravcomp.standard_gravity import STANDARD_GRAVITY
from gravcomp.stream_checks.finding import Block, Finding

WINDOW = 0.5  # s
QUIET = 0.01  # largest deviation of a specific force in a quiet window, of its length
STEADY = math.radians(0.5)  # rad/s, largest deviation of a rate in it
LARGEST_BIAS = math.radians(5.0)  # rad/s: a larger mean rate is rotation
UNIT = 0.2  # relative error of the length that a bad calibration explains
UNCALIBRATED = 0.1  # m/s^2
DRIFT = math.radians(0.15)  # rad/s
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
        count = max(4, round(WINDOW / block.period))
        for begin in range(0, len(block.accel) - count + 1, count):
            accel, gyro = block.accel[begin : begin + count], block.gyro[begin : begin + count]
            mean, rate = accel.mean(axis=0), gyro.mean(axis=0)
            norm = float(np.linalg.norm(mean))
            self._norms.append(norm)
            if accel.std(axis=0).max() <= QUIET * max(norm, 0.3):
                self._quiet.append(mean)
                if gyro.std(axis=0).max() <= STEADY and abs(rate).max() <= LARGEST_BIAS:
                    self._bias.append(rate)

    def findings(self) -> list[Finding]:
        """Return what is odd."""
        return [*self._of_length(), *self._of_bias()]

    @property
    def starts_upside_down(self) -> bool:
        """Whether the specific force of the first quiet window points along -z."""
        first = self._quiet[0] if self._quiet else np.zeros(3)
        return bool(-first[2] > UPSIDE_DOWN * np.linalg.norm(first) > 0.0)

    def _of_length(self) -> list[Finding]:
        norms = np.linalg.norm(self._quiet, axis=1) if len(self._quiet) >= 3 else np.array(self._norms)
        if len(norms) < 3:
            return []
        length = float(np.median(norms))
        if abs(length / STANDARD_GRAVITY - 1.0) <= UNIT:
            error = float(np.mean(np.abs(norms - STANDARD_GRAVITY)))
            if len(self._quiet) < 3 or error <= UNCALIBRATED:
                return []
            text = f"the specific force at rest is {length:.2f} m/s^2: scale or offset of the accelerometer; calibrate"
            return [Finding("accel_calibration", text)]
        for name, unit in UNITS.items():
            if abs(length / unit - 1.0) <= UNIT:
                text = f"the accelerometer is in {name} ({length:.3g} at rest): m/s^2 is needed"
                return [Finding("accel_unit", text, fatal=True, accel_factor=STANDARD_GRAVITY / unit)]
        if length < 0.05 * STANDARD_GRAVITY:
            return [Finding("no_gravity", f"the specific force at rest is {length:.2f}: gravity was removed", fatal=True)]
        return [
            Finding(
                "accel_unit", f"the accelerometer is in no known unit: {length:.3g} at rest, 9.81 m/s^2 is needed", fatal=True
            )
        ]

    def _of_bias(self) -> list[Finding]:
        if len(self._bias) < 20:
            return []
        means = np.array([np.mean(self._bias[i : i + 5], axis=0) for i in range(0, len(self._bias) - 4, 5)])
        drift = float(np.abs(means - means[0]).max())
        if drift <= DRIFT:
            return []
        return [Finding("bias_drift", f"the bias of the gyroscope drifts by {math.degrees(drift):.2f} deg/s: it follows at rest")]
