"""The article's comparison: yaw drift over nine minutes with and without filter and heating, at rest and turning at 23 deg/s.

The IMU is the virtual board (noise, bias, temperature coefficient, quantisation, heater and ambient temperature), read through
its CAN frames. It was stored at 20 degC and is in a room of 28 degC, so that it still warms up without heating. After two
minutes at rest, yaw is compared with the ground truth for nine minutes. Without the filter the raw rate is integrated.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gravcomp.canbus.codec import decode
from gravcomp.canbus.imu_scales import accelerometer_scale, gyroscope_scale
from gravcomp.orientation import EstimatorOptions, GravityEstimator, Problem
from gravcomp.orientation import quaternion as quat
from gravcomp.thermal import HeaterControl, HeaterOptions, ThermalPlantOptions
from gravcomp.virtual.board import VirtualBoard
from gravcomp.virtual.imu_chip import SAMPLE_PERIOD
from gravcomp.virtual.parameters import Board

RATE = math.radians(23.0)  # rad/s, about the vertical
TILT = quat.from_roll_pitch_yaw(math.radians(20.0), math.radians(-30.0), 0.0)  # of the sensor, constant
GRAVITY = 9.81
COLD, ROOM = 20.0, 28.0  # degC
REST, DURATION = 120.0, 540.0  # s


@dataclass(frozen=True, slots=True)
class BoardSample:
    """One sample as decoded from the bus, and the true temperature of the chip."""

    stamp_ns: int
    gyro: tuple[float, float, float]  # rad/s
    accel: tuple[float, float, float]  # m/s^2
    temperature: float  # degC, as reported by the chip
    true_temperature: float  # degC


def board_samples(
    board: Board, heater: HeaterOptions | None, duration: float, rate_at: Callable[[float], float], seed: int
) -> Iterator[BoardSample]:
    """Yield samples of a tilted virtual board that turns about the vertical at rate_at(t) rad/s; heater None: no heating."""
    virtual = VirtualBoard(board, np.random.default_rng(seed))
    control = HeaterControl(heater) if heater is not None else None
    up = np.array(quat.rotate(quat.conjugate(TILT), (0.0, 0.0, 1.0)))
    accel_scale, gyro_scale = accelerometer_scale(board.accelerometer_range), gyroscope_scale(board.gyroscope_range)
    for k in range(round(duration / SAMPLE_PERIOD)):
        time = (k + 1) * SAMPLE_PERIOD
        frames = {f.name: f.values for f in map(decode, virtual.sample(rate_at(time) * up, GRAVITY * up, recorded=False))}
        a, g, t = frames["ImuAccelerometer"], frames["ImuGyroscope"], frames["ImuTime"]
        stamp_ns = round(time * 1e9)
        if control is not None:
            virtual.command_heater(control.update(stamp_ns, t.temperature).duty)
        yield BoardSample(
            stamp_ns=stamp_ns,
            gyro=(g.x * gyro_scale, g.y * gyro_scale, g.z * gyro_scale),
            accel=(a.x * accel_scale, a.y * accel_scale, a.z * accel_scale),
            temperature=t.temperature,
            true_temperature=virtual.temperature,
        )


def ablation(progress: Callable[[str], None], *, duration: float = DURATION, rest: float = REST, seed: int = 1) -> dict:
    """Return the largest yaw drift per motion and pipeline: `yaw_drift_deg` over the run, `yaw_drift_30s_deg` within 30 s."""
    board = replace(Board(), thermal=ThermalPlantOptions(ambient=ROOM, start=COLD))
    figures: dict = {}
    for motion, rate in (("static", 0.0), ("rotating_23_deg_s", RATE)):
        for heated in (True, False):
            heating = "heating" if heated else "no_heating"
            progress(f"yaw over {duration / 60:.0f} min, {motion.replace('_', ' ')}, {heating.replace('_', ' ')}")
            samples = board_samples(board, HeaterOptions() if heated else None, rest + duration, turning_after(rest, rate), seed)
            errors = yaw_errors(samples, rate, rest)
            for name, error in errors.items():
                since = np.degrees(np.unwrap(error))
                figures.setdefault(motion, {})[f"{name}_{heating}"] = {
                    "yaw_drift_deg": round(float(np.abs(since - since[0]).max()), 3),
                    "yaw_drift_30s_deg": round(float(_largest_within(since, 30.0)), 3),
                }
    return figures


def turning_after(rest: float, rate: float) -> Callable[[float], float]:
    """Return the rate over time of a board that is at rest for `rest` s and then turns at `rate`."""
    return lambda time: rate if time > rest else 0.0


def yaw_errors(samples: Iterator[BoardSample], rate: float, rest: float) -> dict[str, np.ndarray]:
    """Return yaw minus true yaw (rad) after `rest` s, for the filter and for the integrated raw rate."""
    estimator = GravityEstimator(EstimatorOptions())
    delay = estimator.options.filter.sensor.delay
    raw = TILT
    filtered, integrated = [], []
    for sample in samples:
        estimator.add_temperature(sample.stamp_ns, sample.temperature)
        estimate = estimator.update(sample.stamp_ns, sample.gyro, sample.accel)
        raw = quat.normalised(quat.multiply(raw, quat.exponential(*(w * SAMPLE_PERIOD for w in sample.gyro))))
        time = sample.stamp_ns * 1e-9
        if time > rest and not isinstance(estimate, Problem):
            true = quat.exponential(0.0, 0.0, rate * (time - rest))
            # The filter compensates a delay of the sensor, which the virtual board does not have.
            ahead = quat.exponential(0.0, 0.0, -rate * delay)
            filtered.append(_yaw_between(quat.multiply(ahead, estimate.imu.orientation), true))
            integrated.append(_yaw_between(raw, true))
    return {"filter": np.array(filtered), "no_filter": np.array(integrated)}


def _yaw_between(orientation: quat.Quaternion, true_turn: quat.Quaternion) -> float:
    """Return the rotation about the vertical (rad) from the true orientation of the tilted sensor to the estimated one."""
    w, _, _, z = quat.multiply(orientation, quat.conjugate(quat.multiply(true_turn, TILT)))
    return 2.0 * math.atan2(z, w)


def _largest_within(values: np.ndarray, window: float) -> float:
    step = round(window / SAMPLE_PERIOD)
    if len(values) <= step:
        return float(np.abs(values - values[0]).max())
    return float(np.abs(values[step:] - values[:-step]).max())
