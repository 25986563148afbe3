"""Measured courses of the tip, and the windows in them in which the robot is at rest."""

import math
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
    specific_force: np.ndarray | None = None  # (t,) m/s^2, its length by the IMU, NaN: not measured; None: never

    def __post_init__(self) -> None:
        for name in ("time", "gravity", "tip_position", "tip_direction"):
            values = getattr(self, name)
            if values is not None and not np.isfinite(values).all():
                raise MeasurementError(f"{self.source}: {name} has values that are not finite numbers")
        for name in ("displacement", "specific_force"):
            values = getattr(self, name)
            if values is not None and np.isinf(values).any():
                raise MeasurementError(f"{self.source}: {name} has values that are infinite")
        if len(self.time) < 2:
            raise MeasurementError(f"{self.source}: has {len(self.time)} samples; at least 2 are needed")
        back = np.flatnonzero((np.diff(self.time) <= 0.0) & (np.diff(self.trial) == 0))
        if len(back):
            one, other = self.time[back[0]], self.time[back[0] + 1]
            raise MeasurementError(
                f"{self.source}: in trial {self.trial[back[0]]} the time goes from {one:g} to {other:g} s; it must increase"
            )

    def trials(self) -> list["Measured"]:
        """Return one measurement per trial."""
        return [self.rows(self.trial == number) for number in dict.fromkeys(self.trial.tolist())]

    def rows(self, which: np.ndarray) -> "Measured":
        """Return the samples selected by a mask or by indices."""
        direction, force = (None if own is None else own[which] for own in (self.tip_direction, self.specific_force))
        return Measured(
            self.source, self.trial[which], self.time[which], self.gravity[which], self.displacement[which],
            self.tip_position[which], direction, force,
        )  # fmt: skip


@dataclass(frozen=True)
class Start:
    """The first sample of a trial: time in s, gravity (3,), displacement (m,). The robot counts as relaxed there."""

    time: float
    gravity: np.ndarray
    displacement: np.ndarray


@dataclass(frozen=True)
class History:
    """When k windows were, in the order of time within each trial.

    trial (k,); began (k,) in s: since when gravity and cables are as in the window; time (k,) in s: of its middle; starts: of the
    trials, by number.
    """

    trial: np.ndarray
    began: np.ndarray
    time: np.ndarray
    starts: dict[int, Start]


@dataclass(frozen=True)
class StillWindows:
    """Means over k windows in which nothing moves, one row per window."""

    gravity: np.ndarray  # (k, 3)
    displacement: np.ndarray  # (k, m), NaN: released
    tip_position: np.ndarray  # (k, 3)
    tip_direction: np.ndarray | None = None  # (k, 3), of length 1; None: not measured
    history: History | None = None  # None: every window is relaxed
    share: np.ndarray | None = None  # (k,): one over the number of windows of the same rest; None: one each
    specific_force: np.ndarray | None = None  # (k,) m/s^2, its length by the IMU, NaN: not measured; None: never

    @property
    def shares(self) -> np.ndarray:
        """(k,) weight of each window: those of one rest count as one measurement, because the model's error is one."""
        return np.ones(len(self.gravity)) if self.share is None else self.share


def still_windows(measured: Measured, still: Standstill, parts: int = 1) -> StillWindows:
    """Return the windows at rest of each trial; at rest, gravity, cables and tip do not move.

    parts: windows of each rest, equally long in the logarithm of the time since cables and base came to rest, because a body
    creeps by such times; with one it is the last window of the rest. Raises MeasurementError if there is none.
    """
    found, starts = [], {}
    for trial in measured.trials():
        number = int(trial.trial[0])
        starts[number] = Start(float(trial.time[0]), trial.gravity[0], trial.displacement[0])
        for first, last in rests_of(trial, still):
            began = _began(trial, first, last, still)
            pieces = _pieces(trial, began, first, last, still, parts)
            for rows in pieces:
                window = trial.rows(rows)
                direction = np.zeros(3) if window.tip_direction is None else window.tip_direction.mean(axis=0)
                length = _mean_of_measured(window.specific_force)
                found.append(
                    (
                        *(part.mean(axis=0) for part in (window.gravity, window.displacement, window.tip_position)),
                        direction,
                        number,
                        trial.time[began],
                        window.time.mean(),
                        1.0 / len(pieces),
                        length,
                    )
                )
    if not found:
        raise MeasurementError(
            f"{measured.source}: the robot is never at rest for {still.time:.2g} s (tip within {1e3 * still.tip:.2g} mm,"
            f" cables within {1e3 * still.cable:.2g} mm: from its first period and its length); let it settle in a few poses"
        )
    gravity, displacement, tip, direction, trials, since, middle, share, force = (np.array(column) for column in zip(*found))
    directed = measured.tip_direction is not None and np.ptp(measured.tip_direction, axis=0).max() > 0.0
    # A tracker of positions alone publishes one and the same orientation.
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True) if directed else None
    forces = None if measured.specific_force is None else force
    return StillWindows(gravity, displacement, tip, unit, History(trials, since, middle, starts), share, forces)


def rests_of(trial: Measured, still: Standstill) -> list[tuple[int, int]]:
    """Return first and last sample of every rest."""
    count, limit = still.samples(trial.time), still.tip_limit(trial.tip_position)
    rests: list[tuple[int, int]] = []
    resting = False
    for start in range(0, len(trial.time) - count + 1, max(1, count // 2)):
        if not _is_still(trial.rows(np.arange(start, start + count)), still, limit):
            resting = False
        elif resting and _same(trial, rests[-1][1], start + count - 1, still):
            rests[-1] = rests[-1][0], start + count - 1
        else:
            rests.append((start, start + count - 1))
            resting = True
    return rests


def _same(trial: Measured, one: int, other: int, still: Standstill) -> bool:
    """Return whether cables and gravity are the same at two samples: slow turns are no rest."""
    return _away(trial, other, np.array([one]), still)[0] <= 1.0


def _away(trial: Measured, row: int, rows: np.ndarray, still: Standstill) -> np.ndarray:
    """Return (r,) how far cables and gravity at `rows` are from those at `row`, over what counts as the same."""
    moved = np.abs(np.nan_to_num(trial.displacement[rows]) - np.nan_to_num(trial.displacement[row])).max(axis=1, initial=0.0)
    released = (np.isnan(trial.displacement[rows]) != np.isnan(trial.displacement[row])).any(axis=1)
    unit = trial.gravity / np.linalg.norm(trial.gravity, axis=1, keepdims=True)
    turned = np.abs(unit[rows] - unit[row]).max(axis=1)
    return np.maximum(np.maximum(moved / (2.0 * still.cable), turned / (2.0 * still.gravity)), np.where(released, np.inf, 0.0))


def _began(trial: Measured, first: int, last: int, still: Standstill) -> int:
    """Return the sample since which cables and gravity are as in the rest."""
    away = np.flatnonzero(_away(trial, last, np.arange(first), still) > 1.0)
    return int(away[-1]) + 1 if len(away) else 0


def _pieces(trial: Measured, began: int, first: int, last: int, still: Standstill, parts: int) -> list[np.ndarray]:
    """Return the samples of the windows of a rest."""
    count = still.samples(trial.time)
    if parts == 1:
        return [np.arange(last - count + 1, last + 1)]
    since = trial.time[first : last + 1] - trial.time[began]
    edges = np.geomspace(max(since[0], 0.1 * still.time), since[-1] + 1e-9, parts + 1)[1:-1]
    pieces = np.split(np.arange(first, last + 1), np.searchsorted(since, edges))
    return [piece for piece in pieces if len(piece) >= count // 2]


def _is_still(window: Measured, still: Standstill, limit: float) -> bool:
    """Return whether nothing moves in the window; limit: for the tip in m."""
    spread = np.ptp(window.tip_position, axis=0).max() <= limit
    released = np.isnan(window.displacement)
    same = (released.all(axis=0) | ~released.any(axis=0)).all()
    cables = np.ptp(np.nan_to_num(window.displacement), axis=0).max(initial=0.0) <= still.cable
    direction = window.gravity / np.linalg.norm(window.gravity, axis=1, keepdims=True)
    turned = np.ptp(direction, axis=0).max() <= still.gravity
    return bool(spread and same and cables and turned)


def _mean_of_measured(values: np.ndarray | None) -> float:
    """Return the mean of the values that are not NaN; NaN: there are none."""
    known = np.zeros(0) if values is None else values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan


def rms_distance(error: np.ndarray) -> float:
    """Return the root mean square length of errors (..., 3)."""
    return float(np.sqrt((error**2).sum(axis=-1).mean()))
