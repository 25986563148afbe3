"""Faulty IMU streams: what is reported, and the error of the inclination beyond that of the clean stream, on the BROAD trials."""

import time
from collections.abc import Callable

import numpy as np

from gravcomp.bench.inclination_error import rmse_deg
from gravcomp.bench.stream_faults import FAULTS, Fault
from gravcomp.orientation import estimate_recording
from gravcomp.orientation.calibration_in_motion import calibrate_in_motion, calibrated
from gravcomp.orientation.errors import CalibrationError
from gravcomp.recordings.imu import Recording
from gravcomp.recordings.imu.broad_folder import WHERE, broad_trials
from gravcomp.stream_checks import StreamMonitor, check_recording, converted


def run(progress: Callable[[str], None], *, seed: int = 1, every: int = 1) -> dict:
    """Return for each fault how many trials do not report it, and the largest excess of the error in deg.

    Every `every`-th trial at 95.2 Hz. `trials`: error of each trial and kinds that are found; `not_calibrated`: trials
    that turn too little to be calibrated from themselves.
    """
    recordings = {name: trial.averaged(3) for name, trial in broad_trials(every).items()}
    if not recordings:
        return {"broad": f"no recordings found. {WHERE}"}
    clean = {name: rmse_deg(estimate_recording(r).orientation, r) for name, r in recordings.items()}
    figures: dict = {
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
                figures["not_calibrated"] = len(results) - len(errors)
            if not errors:
                continue
            excess = max(error - clean[name] for name, error in errors.items())
            figures["excess_deg"][fault_name] = round(excess, 3)
            figures["beyond_limit_deg"][fault_name] = round(max(0.0, excess - fault.excess_deg), 3)
    progress("cost of the live checks")
    figures["us_per_sample"] = _cost(next(iter(recordings.values())))
    return figures


def outcome(fault: Fault, recording: Recording, seed: int) -> tuple[list[str], float | None]:
    """Return the kinds that are found with the fault, and the error in deg where the fault has a limit.

    There is none of a sensor that turns too little to be calibrated.
    """
    faulty = fault.apply(recording, np.random.default_rng(seed))
    findings = check_recording(faulty)
    kinds = sorted({finding.kind for finding in findings} | ({"notes"} if faulty.notes else set()))
    if fault.excess_deg is None:
        return kinds, None
    if fault.convert:
        faulty = converted(faulty, findings)
    if fault.calibrate:
        try:
            faulty = calibrated(faulty, calibrate_in_motion(faulty))
        except CalibrationError:
            return kinds, None
    return kinds, rmse_deg(estimate_recording(faulty).orientation, faulty)


def _cost(recording: Recording) -> float:
    """Return the CPU time of a sample in us."""
    samples = list(recording.samples())
    monitor = StreamMonitor(memory=120.0)
    begin = time.process_time()
    for sample in samples:
        monitor.add(*sample)
    return round(1e6 * (time.process_time() - begin) / len(samples), 2)
