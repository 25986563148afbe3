"""Faults of IMU streams, put into a recording: each is a kind of public bug reports. The same seed gives the same stream."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gravcomp.recordings.imu import Recording
from gravcomp.recordings.imu.stamps import usable_stamps
from gravcomp.standard_gravity import STANDARD_GRAVITY

SPIKES = 0.02  # share of the samples
SWAPPED = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
MIRROR = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Fault:
    """`kinds`: findings of which one has to be reported; `excess_deg`: allowed error beyond that of the clean stream."""

    apply: Callable[[Recording, np.random.Generator], Recording]
    kinds: tuple[str, ...]
    excess_deg: float | None = None
    convert: bool = False  # the error is measured after the conversion
    at_rest: bool = False  # shown by rests among the motion only
    calibrate: bool = False  # the error is measured after a calibration from the recording itself


def _spikes(name: str, largest: float) -> Callable[[Recording, np.random.Generator], Recording]:
    def apply(recording: Recording, random: np.random.Generator) -> Recording:
        hit = random.random((len(recording), 1)) < SPIKES
        values = getattr(recording, name) + hit * random.uniform(-largest, largest, (len(recording), 3))
        return _with(recording, **{name: values})

    return apply


def _with(recording: Recording, **arrays: np.ndarray) -> Recording:
    return replace(recording, **arrays)  # type: ignore[arg-type]


def _scaled(name: str, factor: float) -> Callable[[Recording, np.random.Generator], Recording]:
    return lambda recording, random: _with(recording, **{name: getattr(recording, name) * factor})


def _selected(recording: Recording, index: np.ndarray) -> Recording:
    """Return the samples of the index (m,)."""
    rows = {name: getattr(recording, name)[index] for name in ("stamp_ns", "gyro", "accel", "orientation", "movement")}
    return _with(recording, **rows)


def _uncalibrated(recording: Recording, random: np.random.Generator) -> Recording:
    return _with(recording, accel=recording.accel * 1.03 + 0.2)


def _jitter(recording: Recording, random: np.random.Generator) -> Recording:
    period = 1e9 / recording.rate
    return _with(
        recording, stamp_ns=recording.stamp_ns + np.rint(random.uniform(-0.3, 0.3, len(recording)) * period).astype(np.int64)
    )


def _duplicates(recording: Recording, random: np.random.Generator) -> Recording:
    return _selected(recording, np.repeat(np.arange(len(recording)), 1 + (random.random(len(recording)) < 0.05)))


def _time_back(recording: Recording, random: np.random.Generator) -> Recording:
    index = np.arange(len(recording))
    for place in random.choice(len(recording) - 20, 20, replace=False) + 10:
        index[[place, place + 1]] = index[[place + 1, place]]
    return _selected(recording, index)


def _wrap(recording: Recording, random: np.random.Generator) -> Recording:
    """Return the recording with the stamps of a counter of 32 bits in us that wraps in the middle, as it is read."""
    span = 2**32 * 1000
    counter = (recording.stamp_ns + span - recording.stamp_ns[len(recording) // 2]) // 1000 * 1000 % span
    stamps, notes = usable_stamps(counter, None, recording.gyro)
    return replace(recording, stamp_ns=stamps, notes=notes)


def _gaps(recording: Recording, random: np.random.Generator) -> Recording:
    """Return the recording without five stretches of up to 1 s."""
    keep = np.ones(len(recording), bool)
    for place in random.choice(len(recording) - 400, 5, replace=False) + 200:
        keep[place : place + int(random.uniform(0.2, 0.95) * recording.rate)] = False
    return _selected(recording, np.flatnonzero(keep))


def _clipped(recording: Recording, random: np.random.Generator) -> Recording:
    largest = 0.5 * np.abs(recording.gyro).max()
    return _with(recording, gyro=np.clip(recording.gyro, -largest, largest))


def _stuck(recording: Recording, random: np.random.Generator) -> Recording:
    gyro = recording.gyro.copy()
    begin = len(gyro) // 2
    gyro[begin : begin + int(2.0 * recording.rate)] = gyro[begin]
    return _with(recording, gyro=gyro)


def _quantised(recording: Recording, random: np.random.Generator) -> Recording:
    step = np.radians(2000.0) / 128.0
    return _with(recording, gyro=np.rint(recording.gyro / step) * step)


def _drift(recording: Recording, random: np.random.Generator) -> Recording:
    """Return the recording with 0.5 deg/s of drift, as of a chip that warms up by 33 K."""
    return _with(recording, gyro=recording.gyro + np.radians(0.5) * np.linspace(0.0, 1.0, len(recording))[:, None])


FAULTS: dict[str, Fault] = {
    "gyro_spikes": Fault(_spikes("gyro", np.radians(400.0)), ("gyro_spikes",), 0.25),
    "accel_spikes": Fault(_spikes("accel", 40.0), ("accel_spikes",), 0.25),
    "accel_in_g": Fault(_scaled("accel", 1.0 / STANDARD_GRAVITY), ("accel_unit",), 0.05, convert=True),
    "gyro_in_deg_s": Fault(_scaled("gyro", 180.0 / np.pi), ("gyro_unit",), 0.05, convert=True),
    "gyro_in_millideg_s": Fault(_scaled("gyro", 180e3 / np.pi), ("gyro_unit",), 0.05, convert=True),
    "scale_and_offset": Fault(_uncalibrated, ("accel_calibration",), 0.5, at_rest=True, calibrate=True),
    "accel_negated": Fault(_scaled("accel", -1.0), ("accel_negated",), 0.05, convert=True),
    "other_frame": Fault(
        lambda recording, random: _with(recording, gyro=recording.gyro @ SWAPPED.T), ("frames",), 0.05, convert=True
    ),
    "left_handed": Fault(
        lambda recording, random: _with(recording, gyro=recording.gyro @ MIRROR, accel=recording.accel @ MIRROR),
        ("left_handed",),
    ),
    "rate_halved": Fault(lambda recording, random: _with(recording, stamp_ns=recording.stamp_ns * 2), ("rate",)),
    "rate_doubled": Fault(lambda recording, random: _with(recording, stamp_ns=recording.stamp_ns // 2), ("rate",)),
    "jitter": Fault(_jitter, ("jitter",), 0.25),
    "duplicates": Fault(_duplicates, ("duplicates",), 0.05),
    "time_back": Fault(_time_back, ("time_back",), 0.25),
    "counter_wrap": Fault(_wrap, ("notes",), 0.05),
    "gaps": Fault(_gaps, ("gaps",)),
    "clipped": Fault(_clipped, ("gyro_clipped",)),
    "stuck": Fault(_stuck, ("gyro_stuck",)),
    "quantised": Fault(_quantised, ("gyro_quantised",)),
    "bias_drift": Fault(_drift, ("bias_drift",), at_rest=True),
}
