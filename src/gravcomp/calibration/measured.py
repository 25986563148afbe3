"""Measured courses of the tip, and the windows in them in which the robot is at rest."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.standstill import Standstill


class MeasurementError(ValueError):
    """Measured data that cannot be used; the text says what was found and what is needed."""


@dataclass(frozen=True)
class Measured:
    """t samples of m cables and the tip, ordered by time within each trial. SI, `soft_base`."""

    source: str
    trial: np.ndarray  # (t,) int
    time: np.ndarray  # (t,) s
    gravity: np.ndarray  # (t, 3)
    displacement: np.ndarray  # (t, m), NaN: released
    tip_position: np.ndarray  # (t, 3)
    tip_direction: np.ndarray | None = None  # (t, 3)

    def __post_init__(self) -> None:
        for name in ("time", "gravity", "tip_position"):
            if not np.isfinite(getattr(self, name)).all():
                raise MeasurementError(f"{self.source}: {name} has values that are not finite numbers")
        if len(self.time) < 2:
            raise MeasurementError(f"{self.source}: has {len(self.time)} samples; at least 2 are needed")

    def trials(self) -> list["Measured"]:
        """Return one measurement per trial."""
        return [self.rows(self.trial == number) for number in dict.fromkeys(self.trial.tolist())]

    def rows(self, which: np.ndarray) -> "Measured":
        """Return the samples selected by a mask or by indices."""
        direction = None if self.tip_direction is None else self.tip_direction[which]
        return Measured(
            self.source, self.trial[which], self.time[which], self.gravity[which], self.displacement[which],
            self.tip_position[which], direction,
        )  # fmt: skip


@dataclass(frozen=True)
class StillWindows:
    """Means over k windows in which nothing moves, one row per window."""

    gravity: np.ndarray  # (k, 3)
    displacement: np.ndarray  # (k, m), NaN: released
    tip_position: np.ndarray  # (k, 3)
    tip_direction: np.ndarray | None = None  # (k, 3), of length 1; None: not measured


def still_windows(measured: Measured, still: Standstill) -> StillWindows:
    """Return the last window of every period of rest of each trial; at rest, gravity, cables and tip do not move.

    Raises MeasurementError if there is none.
    """
    found = []
    for trial in measured.trials():
        found += _windows_of(trial, still)
    if not found:
        raise MeasurementError(
            f"{measured.source}: the robot is never at rest for {still.time:.2g} s (tip within {1e3 * still.tip:.2g} mm,"
            f" cables within {1e3 * still.cable:.2g} mm: from its first period and its length); let it settle in a few poses"
        )
    gravity, displacement, tip, direction = (np.array(column) for column in zip(*found))
    if measured.tip_direction is None or np.ptp(measured.tip_direction, axis=0).max() == 0.0:
        # A tracker of positions alone publishes one and the same orientation.
        return StillWindows(gravity, displacement, tip)
    return StillWindows(gravity, displacement, tip, direction / np.linalg.norm(direction, axis=1, keepdims=True))


def _windows_of(trial: Measured, still: Standstill) -> list[tuple]:
    """Return the last window at rest before each movement, and before the end of the trial."""
    count, limit = still.samples(trial.time), still.tip_limit(trial.tip_position)
    windows, last = [], None
    for start in range(0, len(trial.time) - count + 1, max(1, count // 2)):
        window = trial.rows(np.arange(start, start + count))
        if _is_still(window, still, limit):
            direction = np.zeros(3) if window.tip_direction is None else window.tip_direction.mean(axis=0)
            last = (
                window.gravity.mean(axis=0), window.displacement.mean(axis=0), window.tip_position.mean(axis=0), direction
            )  # fmt: skip
        elif last is not None:
            windows.append(last)
            last = None
    return windows + ([last] if last is not None else [])


def _is_still(window: Measured, still: Standstill, limit: float) -> bool:
    """Return whether nothing moves in the window; limit: for the tip in m."""
    spread = np.ptp(window.tip_position, axis=0).max() <= limit
    released = np.isnan(window.displacement)
    same = (released.all(axis=0) | ~released.any(axis=0)).all()
    cables = np.ptp(np.nan_to_num(window.displacement), axis=0).max(initial=0.0) <= still.cable
    direction = window.gravity / np.linalg.norm(window.gravity, axis=1, keepdims=True)
    turned = np.ptp(direction, axis=0).max() <= still.gravity
    return bool(spread and same and cables and turned)


def rms_distance(error: np.ndarray) -> float:
    """Return the root mean square length of errors (..., 3)."""
    return float(np.sqrt((error**2).sum(axis=-1).mean()))
