"""The estimator over a whole recording, as fast as possible; the result is that of the node."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gravcomp.orientation.estimator import GravityEstimator
from gravcomp.orientation.filter import MISSED_PERIODS
from gravcomp.orientation.guard import Problem
from gravcomp.orientation.spike_review import AHEAD, SURE_GYRO, SpikeReview
from gravcomp.orientation.spikes import SpikeOptions
from gravcomp.recordings.imu import Recording

PROGRESS_EVERY = 2000  # samples


@dataclass(frozen=True)
class EstimatedRecording:
    """One row for each sample; a rejected sample repeats the previous row; NaN before the first estimate."""

    stamp_ns: np.ndarray  # (n,) int64, ns
    orientation: np.ndarray  # (n, 4) w x y z, sensor to earth
    gravity: np.ndarray  # (n, 3) m/s^2, soft_base
    bias: np.ndarray  # (n, 3) rad/s, of the raw rate
    rest: np.ndarray  # (n,) bool
    inclination_std: np.ndarray  # (n,) rad
    problems: dict[str, int]  # text of the problem -> number of samples


def estimate_recording(
    recording: Recording, estimator: GravityEstimator | None = None, progress: Callable[[float], None] | None = None
) -> EstimatedRecording:
    """Return the results of the estimator (default: one with default options); `progress` receives the completed fraction."""
    estimator = estimator or GravityEstimator()
    count = len(recording)
    rows = np.full((count, 12), np.nan)
    problems: dict[str, int] = {}
    row: tuple | None = None
    temperatures = _temperatures(recording)
    next_temperature = next(temperatures, None)
    for i, (stamp_ns, gyro, accel) in enumerate(recording.samples()):
        while next_temperature is not None and next_temperature[0] <= stamp_ns:
            estimator.add_temperature(*next_temperature)
            next_temperature = next(temperatures, None)
        result = estimator.update(stamp_ns, gyro, accel)
        if isinstance(result, Problem):
            problems[result.value] = problems.get(result.value, 0) + 1
        else:
            imu = result.imu
            row = (*imu.orientation, *result.gravity, *result.bias, imu.rest, imu.inclination_std)
            if imu.problem is not Problem.NONE:
                problems[imu.problem.value] = problems.get(imu.problem.value, 0) + 1
        if row is not None:
            rows[i] = row
        if progress is not None and i % PROGRESS_EVERY == 0:
            progress(i / count)
    return EstimatedRecording(
        stamp_ns=recording.stamp_ns,
        orientation=rows[:, :4],
        gravity=rows[:, 4:7],
        bias=rows[:, 7:10],
        rest=rows[:, 10] == 1.0,
        inclination_std=rows[:, 11],
        problems=problems,
    )


def without_rate_spikes(recording: Recording, options: SpikeOptions) -> Recording:
    """Return the recording without single spikes of the rate, for what takes means of samples: a mean would hide them."""
    review, gyro, longest = SpikeReview(options.gyro, options, SURE_GYRO), recording.gyro.copy(), MISSED_PERIODS / recording.rate
    before = int(recording.stamp_ns[0])
    for i, (stamp_ns, rate, _) in enumerate(recording.samples()):
        dt, before = (stamp_ns - before) * 1e-9, stamp_ns
        if not 0.0 <= dt <= longest or not math.isfinite(sum(rate)):
            review.reset()
            continue
        decided = review.take(dt, (rate[0], rate[1], rate[2]))
        if decided is not None:
            gyro[i - AHEAD] = decided
    return replace(recording, gyro=gyro)


def _temperatures(recording: Recording) -> Iterator[tuple[int, float]]:
    if recording.temperature is None or recording.temperature_stamp_ns is None:
        return iter(())
    return zip(recording.temperature_stamp_ns.tolist(), recording.temperature.tolist())
