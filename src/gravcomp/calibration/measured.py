"""Measured courses of the tip, and the windows in them in which the robot is at rest."""

import math
from dataclasses import dataclass

import numpy as np

STILL_TIME = 0.5  # s: length of a window
STILL_TIP = 0.6e-3  # m: largest motion of the tip in a window
STILL_CABLE = 0.05e-3  # m: of a cable
STILL_GRAVITY = math.radians(0.5)  # rad: of the gravity direction


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


def still_windows(measured: Measured) -> StillWindows:
    """Return the last window of every period of rest of each trial; at rest, gravity, cables and tip do not move.

    Raises MeasurementError if there is none.
    """
    found = []
    for trial in measured.trials():
        found += _windows_of(trial)
    if not found:
        raise MeasurementError(
            f"{measured.source}: the robot is never at rest for {STILL_TIME:g} s (tip within {1e3 * STILL_TIP:g} mm,"
            f" cables within {1e3 * STILL_CABLE:g} mm); let it settle in a few poses"
        )
    return StillWindows(*(np.array(column) for column in zip(*found)))


def _windows_of(trial: Measured) -> list[tuple]:
    """Return the last window at rest before each movement, and before the end of the trial."""
    count = max(2, round(STILL_TIME / max(np.median(np.diff(trial.time)), 1e-6)))
    windows, last = [], None
    for start in range(0, len(trial.time) - count + 1, max(1, count // 2)):
        window = trial.rows(np.arange(start, start + count))
        if _is_still(window):
            last = (window.gravity.mean(axis=0), window.displacement.mean(axis=0), window.tip_position.mean(axis=0))
        elif last is not None:
            windows.append(last)
            last = None
    return windows + ([last] if last is not None else [])


def _is_still(window: Measured) -> bool:
    """Return whether nothing moves in the window."""
    spread = np.ptp(window.tip_position, axis=0).max() <= STILL_TIP
    released = np.isnan(window.displacement)
    same = (released.all(axis=0) | ~released.any(axis=0)).all()
    cables = np.ptp(np.nan_to_num(window.displacement), axis=0).max(initial=0.0) <= STILL_CABLE
    direction = window.gravity / np.linalg.norm(window.gravity, axis=1, keepdims=True)
    turned = np.ptp(direction, axis=0).max() <= STILL_GRAVITY
    return bool(spread and same and cables and turned)
