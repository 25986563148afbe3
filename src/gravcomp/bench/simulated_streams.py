"""IMU recordings with known truth of sensors and motions that BROAD does not have.

A sensor rests, then turns and moves with a bounded velocity, with pauses or without. Its samples have noise, biases, a step of
quantisation and stamps with jitter, as a data sheet or a driver gives them. The same kind and seed give the same recording.
"""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.orientation import quaternion as quat
from gravcomp.recordings.imu import Recording
from gravcomp.standard_gravity import STANDARD_GRAVITY

_DEG = math.pi / 180.0
_WAVES = 4  # sinusoids of a motion, for each axis
_RAMP = 0.7  # s in which a motion begins and ends
_UPRIGHT = 20.0 * _DEG  # largest tilt at the start of a sensor that is not mounted otherwise


@dataclass(frozen=True)
class Kind:
    """One kind of sensor and motion. SI; amplitudes are RMS of an axis while it moves."""

    rate: float  # Hz
    turning: float  # rad/s
    turning_hz: float  # highest frequency
    speed: float  # m/s
    speed_hz: float  # highest frequency
    first_rest: float = 3.0  # s
    pauses: bool = True  # of 2 to 4 s, after 6 to 12 s of motion
    shaking: tuple[float, float] = (0.0, 0.0)  # m/s^2 and rad/s, while it moves
    shaking_hz: tuple[float, float] = (60.0, 180.0)
    gyro_noise: float = 0.01 * _DEG  # rad/s/sqrt(Hz)
    accel_noise: float = 150e-6 * STANDARD_GRAVITY  # m/s^2/sqrt(Hz)
    gyro_bias: float = 0.3 * _DEG  # rad/s, RMS
    accel_offset: float = 0.02  # m/s^2, RMS
    gyro_step: float = 2000.0 * _DEG / 2**15  # rad/s, quantisation
    accel_step: float = 16.0 * STANDARD_GRAVITY / 2**15  # m/s^2
    jitter: float = 0.0  # of the period, RMS
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)  # the sensor's axis that points up at the start


KINDS: dict[str, Kind] = {
    "hand, slow": Kind(100.0, 0.4, 0.4, 0.1, 0.6, pauses=False, shaking=(0.1, 0.02), shaking_hz=(6.0, 12.0)),
    "hand, no rest": Kind(
        100.0, 0.6, 0.5, 0.15, 0.6, first_rest=0.0, pauses=False, shaking=(0.1, 0.02), shaking_hz=(6.0, 12.0)
    ),
    "arm at 2 m/s^2": Kind(200.0, 0.6, 0.5, 0.35, 0.9, gyro_bias=0.1 * _DEG),
    "drone": Kind(200.0, 0.5, 0.6, 0.6, 0.5, pauses=False, shaking=(4.0, 0.15)),
    "phone": Kind(100.0, 0.9, 0.8, 0.3, 0.8, gyro_bias=1.0 * _DEG, accel_offset=0.04, jitter=0.03),
    "1000 Hz": Kind(1000.0, 0.8, 0.7, 0.2, 0.8, gyro_noise=0.03 * _DEG, accel_noise=400e-6 * STANDARD_GRAVITY),
    "12 bit": Kind(
        100.0, 0.8, 0.7, 0.2, 0.8, gyro_step=2000.0 * _DEG / 2**11, accel_step=16.0 * STANDARD_GRAVITY / 2**11
    ),
    "on its side": Kind(100.0, 0.6, 0.5, 0.2, 0.6, up=(1.0, 0.0, 0.0)),
    "25 Hz": Kind(25.0, 0.4, 0.3, 0.15, 0.4),
}  # fmt: skip


def simulated(kind: Kind, seed: int, duration: float = 60.0) -> Recording:
    """Return a recording of `duration` s, with its true orientation."""
    random = np.random.default_rng(seed)
    period = 1.0 / kind.rate
    time = np.arange(round(duration * kind.rate)) * period
    moving = _moving(kind, time, random)
    rate = kind.turning * moving[:, None] * _waves(time, kind.turning_hz, random)
    orientation = _orientation(kind, rate, period, random)
    velocity = kind.speed * moving[:, None] * _waves(time, kind.speed_hz, random)
    force = np.gradient(velocity, period, axis=0) + np.array([0.0, 0.0, STANDARD_GRAVITY])
    accel = _to_sensor(orientation, force)
    shaking = [moving[:, None] * size * _shaking(kind, time, random) for size in kind.shaking]
    half_band = math.sqrt(0.5 * kind.rate)
    shape = accel.shape
    gyro = rate + shaking[1] + kind.gyro_bias * random.standard_normal(3)
    gyro += kind.gyro_noise * half_band * random.standard_normal(shape)
    accel = accel + shaking[0] + kind.accel_offset * random.standard_normal(3)
    accel += kind.accel_noise * half_band * random.standard_normal(shape)
    stamps = 1.7e9 + time + np.clip(kind.jitter * random.standard_normal(len(time)), -0.3, 0.3) * period
    return Recording(
        source="simulated",
        stamp_ns=np.rint(stamps * 1e9).astype(np.int64),
        gyro=np.rint(gyro / kind.gyro_step) * kind.gyro_step,
        accel=np.rint(accel / kind.accel_step) * kind.accel_step,
        orientation=orientation,
        movement=moving > 0.0,
    )


def _moving(kind: Kind, time: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the share (n,) of the motion that is made at each time: 0 at rest, 1 in motion."""
    if not kind.first_rest:
        return np.ones(len(time))
    moving, begin = np.zeros(len(time)), kind.first_rest
    while begin < time[-1]:
        end = begin + random.uniform(6.0, 12.0) if kind.pauses else time[-1] + 2.0 * _RAMP
        inside = np.clip(np.minimum(time - begin, end - time) / _RAMP, 0.0, 1.0)
        moving += 0.5 - 0.5 * np.cos(np.pi * inside)
        begin = end + random.uniform(2.0, 4.0)
    return moving


def _waves(time: np.ndarray, highest_hz: float, random: np.random.Generator) -> np.ndarray:
    """Return a smooth signal (n, 3) with an RMS of 1."""
    frequency = random.uniform(0.2 * highest_hz, highest_hz, (_WAVES, 3))
    phase = random.uniform(0.0, 2.0 * np.pi, (_WAVES, 3))
    return math.sqrt(2.0 / _WAVES) * np.sin(2.0 * np.pi * frequency * time[:, None, None] + phase).sum(axis=1)


def _shaking(kind: Kind, time: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return vibration (n, 3) with an RMS of about 1: a tone and its harmonics, that wander."""
    low, high = kind.shaking_hz
    wander = np.cumsum(random.standard_normal(len(time))) * math.sqrt(1.0 / kind.rate)
    tones = random.uniform(low, high, 3)[:, None] * (time + 0.01 * wander)
    return math.sqrt(2.0 / 3.0) * np.sin(2.0 * np.pi * tones.T[:, :, None] + random.uniform(0.0, 6.0, (3, 3))).sum(axis=1)


def _orientation(kind: Kind, rate: np.ndarray, period: float, random: np.random.Generator) -> np.ndarray:
    """Return the orientation (n, 4), sensor to earth, after the turn of each period."""
    up = np.array(kind.up)
    axis = random.standard_normal(3)
    now = quat.exponential(*(random.uniform(0.0, _UPRIGHT) * axis / np.linalg.norm(axis)))
    across = np.cross(up, [0.0, 0.0, 1.0])
    if np.linalg.norm(across) > 0.0:
        angle = math.acos(float(up[2]))
        now = quat.multiply(now, quat.exponential(*(angle * across / np.linalg.norm(across))))
    found = np.empty((len(rate), 4))
    for k, turn in enumerate((rate * period).tolist()):
        now = quat.normalised(quat.multiply(now, quat.exponential(*turn)))
        found[k] = now
    return found


def _to_sensor(orientation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return vectors (n, 3) of the earth in the sensor's frame."""
    real, axis = orientation[:, :1], -orientation[:, 1:]
    across = 2.0 * np.cross(axis, vectors)
    return vectors + real * across + np.cross(axis, across)
