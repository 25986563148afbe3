"""Faulty IMU streams: what is reported, and the error of the inclination beyond that of the clean stream, on the BROAD trials."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gravcomp.bench.inclination_error import rmse_deg
from gravcomp.bench.simulated_streams import KINDS, simulated
from gravcomp.bench.stream_faults import FAULTS, Fault
from gravcomp.bench.stream_gaps import GAPS, after_gaps
from gravcomp.orientation import estimate_recording
from gravcomp.orientation.calibration_in_motion import calibrated
from gravcomp.orientation.self_calibration import calibrate_from_itself
from gravcomp.recordings.imu import Recording
from gravcomp.recordings.imu.broad_folder import WHERE, broad_trials
from gravcomp.stream_checks import StreamMonitor, check_recording, converted


def run(progress: Callable[[str], None], *, seed: int = 1, every: int = 1, seeds: int = 2) -> dict:
    """Return for each fault how many trials do not report it, and the largest excess of the error in deg.

    Every `every`-th trial at 95.2 Hz. `trials`: error of each trial and kinds that are found; `partly_calibrated`: trials that
    turn too little to be calibrated from themselves, which is reported; their excess is `partly_calibrated_deg`. `simulated`: how
    many of the findings on clean recordings of other kinds, `seeds` of each, are false, and which faults are not reported there.
    """
    others = simulated_kinds(progress, seed, seeds)
    recordings = {name: trial.averaged(3) for name, trial in broad_trials(every).items()}
    if not recordings:
        return {"simulated": others, "broad": f"no recordings found. {WHERE}"}
    clean = {name: rmse_deg(estimate_recording(r).orientation, r) for name, r in recordings.items()}
    figures: dict = {
        "simulated": others,
        "false_reports": sum(len(check_recording(r)) for r in recordings.values()),
        "clean_deg": clean,
        "missed": {},
        "excess_deg": {},
        "beyond_limit_deg": {},
        "trials": {},
    }
    for fault_name, fault in FAULTS.items():
        progress(fault_name.replace("_", " "))
        results = {name: outcome(fault, recording, seed) for name, recording in recordings.items()}
        figures["trials"][fault_name] = {name: {"kinds": kinds, "error_deg": error} for name, (kinds, error) in results.items()}
        figures["missed"][fault_name] = sum(not set(kinds) & set(fault.kinds) for kinds, _ in results.values())
        if fault.excess_deg is not None:
            errors = {name: error for name, (_, error) in results.items() if error is not None}
            if fault.calibrate:
                partly = {name: error - clean[name] for name, error in errors.items() if "left_open" in results[name][0]}
                errors = {name: error for name, error in errors.items() if name not in partly}
                figures["partly_calibrated"] = len(partly)
                figures["partly_calibrated_deg"] = round(max(partly.values(), default=0.0), 3)
            if not errors:
                continue
            excess = max(error - clean[name] for name, error in errors.items())
            figures["excess_deg"][fault_name] = round(excess, 3)
            figures["beyond_limit_deg"][fault_name] = round(max(0.0, excess - fault.excess_deg), 3)
    progress("cost of the live checks")
    figures["us_per_sample"] = _cost(next(iter(recordings.values())))
    return figures


def simulated_kinds(progress: Callable[[str], None], seed: int, seeds: int) -> dict:
    """Return what is reported of recordings of the simulated kinds, with and without faults, and what spikes and gaps cost there.

    A fault that rests alone show is left out for kinds without. `after_gap_deg`: RMS of the error at once, 1 s and 5 s after
    a gap, for each length of it in s; `after_gap_sigmas`: the largest error after any of them, in standard deviations.
    """
    figures: dict = {"recordings": seeds * len(KINDS), "false_reports": 0, "missed": {}, "excess_deg": {}}
    figures |= {"after_gap_deg": {}, "after_gap_sigmas": {}}
    for name, kind in KINDS.items() if seeds else ():
        progress(f"simulated: {name}")
        gaps: dict[float, list[tuple[np.ndarray, float]]] = {gap: [] for gap in GAPS}
        for number in range(seed, seed + seeds):
            recording = simulated(kind, number)
            figures["false_reports"] += len(check_recording(recording))
            clean = rmse_deg(estimate_recording(recording).orientation, recording)
            for gap, found in gaps.items():
                found.append(after_gaps(recording, gap))
            for fault_name, fault in FAULTS.items():
                if fault.at_rest and not kind.pauses:
                    continue
                held = fault_name.endswith("_spikes")
                kinds, error = outcome(fault if held else replace(fault, excess_deg=None), recording, number)
                missed = not set(kinds) & set(fault.kinds)
                figures["missed"][fault_name] = figures["missed"].get(fault_name, 0) + missed
                if error is not None:
                    excess = figures["excess_deg"].setdefault(fault_name, {})
                    excess[name] = round(max(excess.get(name, 0.0), error - clean), 3)
        figures["after_gap_deg"][name] = {str(gap): _rms([each for each, _ in found]) for gap, found in gaps.items()}
        figures["after_gap_sigmas"][name] = round(max(largest for found in gaps.values() for _, largest in found), 2)
    return figures


def _rms(errors: list[np.ndarray]) -> list[float]:
    """Return the RMS of the rows of the arrays (k, n): n values."""
    squares = np.square(np.concatenate(errors))
    return [round(float(value), 2) for value in np.sqrt(squares.mean(axis=0))]


def outcome(fault: Fault, recording: Recording, seed: int) -> tuple[list[str], float | None]:
    """Return the kinds that are found with the fault, and the error in deg where the fault has a limit.

    Where the sensor turns too little to be calibrated, `left_open` is among the kinds.
    """
    faulty = fault.apply(recording, np.random.default_rng(seed))
    findings = check_recording(faulty)
    kinds = sorted({finding.kind for finding in findings} | ({"notes"} if faulty.notes else set()))
    if fault.excess_deg is None:
        return kinds, None
    if fault.convert:
        faulty = converted(faulty, findings)
    if fault.calibrate:
        correction, left_open = calibrate_from_itself(faulty)
        faulty = calibrated(faulty, correction)
        kinds += ["left_open"] if left_open else []
    return kinds, rmse_deg(estimate_recording(faulty).orientation, faulty)


def _cost(recording: Recording) -> float:
    """Return the CPU time of a sample in us."""
    samples = list(recording.samples())
    monitor = StreamMonitor(memory=120.0)
    begin = time.process_time()
    for sample in samples:
        monitor.add(*sample)
    return round(1e6 * (time.process_time() - begin) / len(samples), 2)
