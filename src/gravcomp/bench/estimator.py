"""Orientation estimate: inclination on BROAD, other filters, jitter, cost, temperature control and the article's ablation.

BROAD's protocol is the RMSE of the inclination over the moving part of each trial; 95.2 Hz is the mean of every three samples.
All figures use the default parameters. Without the recordings their figures are missing, and `broad` explains how to get them.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gravcomp.bench.inclination_error import rmse_deg
from gravcomp.bench.orientation_peers import run_peers
from gravcomp.orientation import EstimatorOptions, FilterOptions, GravityEstimate, GravityEstimator, estimate_recording
from gravcomp.orientation.options import SensorOptions
from gravcomp.orientation.prediction import PredictionOptions
from gravcomp.recordings.imu import Recording
from gravcomp.recordings.imu.broad_folder import WHERE, broad_trials
from gravcomp.thermal import HeaterOptions
from gravcomp.thermal.plant import ThermalPlantOptions
from gravcomp.trials.yaw_drift import DURATION, REST, ablation, board_samples
from gravcomp.virtual.imu_chip import SAMPLE_PERIOD
from gravcomp.virtual.parameters import Board

BIAS = math.radians(1.0) * np.array([1.0, -1.0, 1.0]) / math.sqrt(3.0)  # rad/s, added
WARM_UP = math.radians(0.3) * np.array([1.0, 1.0, -1.0]) / math.sqrt(3.0)  # rad/s: 20 K at the BMI088's coefficient
WARM_UP_TIME = 60.0  # s
HORIZON = 0.02  # s
CHUNK, CHUNKS = 500, 20  # samples, number
REST_TIME, HEATING_TIME = (40.0, 15.0), (300.0, 60.0)  # s: of the whole benchmark, of a brief one
FROM_REST_TIME = 10.0  # s at rest that do not count: the filter settles


def run(progress: Callable[[str], None], *, every: int = 1) -> dict:
    """Return all figures of the estimator, on every `every`-th of the trials and of the minutes; the keys give the units."""
    figures: dict = {}
    full = broad_trials(every)
    if full:
        figures |= _on_broad({name: r.averaged(3) for name, r in full.items()}, full, progress)
    else:
        figures["broad"] = f"no recordings found. {WHERE}"
    progress("at rest on the virtual board")
    brief = every > 1
    figures["virtual_rest_jitter_deg"] = _virtual_jitter(REST_TIME[brief])
    figures["us_per_sample"] = _cost(max(3, CHUNKS // every))
    progress("temperature control from 20 degC")
    figures["thermal"] = _thermal(HEATING_TIME[brief])
    figures["ablation"] = ablation(progress, duration=DURATION / every, rest=REST / every)
    return figures


def _on_broad(low: dict[str, Recording], full: dict[str, Recording], progress: Callable[[str], None]) -> dict:
    trials: dict[str, dict] = {name: {} for name in low}
    jitter = {}
    variants = {
        "95hz_deg": (low, EstimatorOptions()),
        "full_rate_deg": (full, EstimatorOptions()),
        "biased_deg": ({name: _biased(r) for name, r in low.items()}, EstimatorOptions()),
        "without_delay_deg": (low, EstimatorOptions(filter=FilterOptions(sensor=SensorOptions(delay=0.0)))),
    }
    for key, (recordings, options) in variants.items():
        for name, recording in recordings.items():
            progress(f"{name}, {key.removesuffix('_deg').replace('_', ' ')}")
            result = estimate_recording(recording, GravityEstimator(options))
            trials[name][key] = rmse_deg(result.orientation, recording)
            if key == "95hz_deg":
                jitter[name] = round(_jitter(result.gravity[_settled_rest(recording)]), 4)
    mean = {key: round(float(np.mean([t[key] for t in trials.values()])), 4) for key in variants}
    peers = run_peers(low, progress)
    return {
        "broad_deg": max(mean["95hz_deg"], mean["full_rate_deg"]),
        "broad_95hz_deg": mean["95hz_deg"],
        "broad_full_rate_deg": mean["full_rate_deg"],
        "broad_biased_deg": mean["biased_deg"],
        "broad_without_delay_deg": mean["without_delay_deg"],
        "broad_trials": trials,
        "rest_jitter_deg": round(float(np.sqrt(np.mean(np.square(list(jitter.values()))))), 4),
        "rest_jitter_trials_deg": jitter,
        "peers_deg": peers,
        "prediction": _prediction(low, progress),
    }


def _biased(recording: Recording) -> Recording:
    """Return the recording with 1 deg/s of bias and a warm-up drift added to its rates."""
    since = 1e-9 * (recording.stamp_ns - recording.stamp_ns[0])
    drift = (1.0 - np.exp(-since / WARM_UP_TIME))[:, None] * WARM_UP
    return replace(recording, gyro=recording.gyro + BIAS + drift)


def _prediction(recordings: dict[str, Recording], progress: Callable[[str], None]) -> dict:
    """Return the error of gravity with and without prediction, against the ground truth at the later time."""
    errors: dict[str, list[float]] = {"without_deg": [], "with_deg": []}
    horizon = 0.0
    for name, recording in recordings.items():
        progress(f"{name}, prediction")
        steps = round(HORIZON * recording.rate)
        horizon = steps / recording.rate
        options = EstimatorOptions(prediction=PredictionOptions(horizon=horizon))
        result = estimate_recording(recording, GravityEstimator(options))
        assert recording.orientation is not None and recording.movement is not None  # every trial of BROAD has both
        later = recording.orientation[steps:]
        # Gravity depends on the orientation without its rotation about the vertical.
        for key, gravity in (("with_deg", result.gravity), ("without_deg", _gravity_of(result.orientation))):
            angle = _angle(gravity[:-steps], _gravity_of(later))
            counted = recording.movement[steps:] & np.isfinite(angle)
            errors[key].append(float(np.degrees(np.sqrt(np.mean(angle[counted] ** 2)))))
    return {"horizon_ms": round(1e3 * horizon, 2)} | {key: round(float(np.mean(e)), 4) for key, e in errors.items()}


def _gravity_of(orientation: np.ndarray) -> np.ndarray:
    """Return the direction of gravity (n, 3) in the sensor's frame."""
    w, x, y, z = orientation.T
    return -np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))


def _settled_rest(recording: Recording) -> np.ndarray:
    """Return the samples from 10 s on until 2 s before the first motion, (n,) bool."""
    assert recording.movement is not None  # every trial of BROAD has it
    first_motion = int(np.argmax(recording.movement))
    index = np.arange(len(recording))
    return (index > 10.0 * recording.rate) & (index < first_motion - 2.0 * recording.rate)


def _jitter(gravity: np.ndarray) -> float:
    """Return the RMS angle of the directions to their mean, deg."""
    return float(np.degrees(np.sqrt(np.mean(_angle(gravity, np.broadcast_to(gravity.mean(axis=0), gravity.shape)) ** 2))))


def _virtual_jitter(duration: float) -> float:
    estimator, gravity = GravityEstimator(), []
    for sample in board_samples(Board(), None, duration, lambda t: 0.0, seed=1):
        estimate = estimator.update(sample.stamp_ns, sample.gyro, sample.accel)
        assert isinstance(estimate, GravityEstimate)  # the virtual board's samples are valid
        gravity.append(estimate.gravity)
    return round(_jitter(np.array(gravity[round(FROM_REST_TIME / SAMPLE_PERIOD) :])), 4)


def _cost(chunks: int) -> float:
    """Return the CPU time of a sample in us at 100 Hz in motion, median over chunks."""
    random = np.random.default_rng(1)
    count = chunks * CHUNK
    phase = 2.0 * math.pi * np.arange(count)[:, None] / 100.0 * np.array([0.3, 0.4, 0.5])
    gyro = (np.sin(phase) + random.normal(0.0, 0.002, (count, 3))).tolist()
    accel = (np.array([0.0, 0.0, 9.81]) + 2.0 * np.cos(phase) + random.normal(0.0, 0.02, (count, 3))).tolist()
    estimator, costs = GravityEstimator(), []
    for begin in range(0, count, CHUNK):
        started = time.process_time()
        for i in range(begin, begin + CHUNK):
            estimator.update(10_000_000 * i, gyro[i], accel[i])
        costs.append((time.process_time() - started) / CHUNK)
    return round(1e6 * float(np.median(costs)), 1)


def _thermal(duration: float) -> dict:
    """Return the figures of heating the virtual board from 20 degC by 15 degC; `settled_s`: None if not within `duration`."""
    options = HeaterOptions(margin=0.5)
    samples = list(board_samples(Board(), options, duration, lambda t: 0.0, seed=1))
    target = ThermalPlantOptions().ambient + options.rise
    temperature = np.array([s.true_temperature for s in samples])
    outside = np.flatnonzero(np.abs(temperature - target) > 0.5)
    return {
        "target_degc": target,
        "settled_s": round((int(outside[-1]) + 2) * 0.01, 2) if outside[-1] + 1 < len(samples) else None,
        "overshoot_degc": round(max(0.0, float(temperature.max()) - target), 3),
    }
