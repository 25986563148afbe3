"""The loop with a tracker of the tip, on virtual robots that creep strongly and have another modulus than the model.

The tracker measures at 5 Hz, 100 ms late, with 0.5 mm of noise along each axis; some measurements are lost, some are anywhere.
The modulus is 15 % below the model's for every other seed, and 15 % above it for the rest.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gravcomp.closed_loop.setup import Setup
from gravcomp.description import load_robot_file
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.sweep import Sweep
from gravcomp.trials.tracked import TrackedCase, TrackedOutcome, run_tracked, with_wrong_model

STIFFNESS = (0.85, 1.15)
TRACKER = VirtualTrackerParameters(rate=5.0, delay=0.1, std=0.5e-3, dropouts=0.1, outliers=0.05)
POSES = ((0.0, 0.0), (-45.0, 45.0))  # inclination, roll, deg
_TURNING = 30.0  # deg/s


def run(progress: Callable[[str], None], *, files: Sequence[str] = (), seeds: int = 3, brief: bool = False) -> dict:
    """Return `robots`: figures of each robot by its name, worst over seeds and poses.

    `tracked_mm` and `untracked_mm`: RMS of the lateral error, held; `tracked_pct`: of the released sag in the same case;
    `tracked_moving_mm` and `untracked_moving_mm`: while the base turns. files: robot files or names of shipped robots, none:
    article; brief: one pose and shorter runs, in this process. Raises ConfigError.
    """
    sweep = Sweep(1 if brief else None)
    return {"robots": dict(_of(file, seeds, brief, sweep, progress) for file in files or ["article"])}


def _of(file: str, seeds: int, brief: bool, sweep: Sweep, progress: Callable[[str], None]) -> tuple[str, dict[str, Any]]:
    described = load_robot_file(file)
    name = described.robot.name or Path(file).stem
    poses = POSES[:1] if brief else POSES
    cases = {
        "tracked": [TrackedCase(*pose, tracker=TRACKER, brief=brief) for pose in poses],
        "untracked": [TrackedCase(*pose, brief=brief) for pose in poses],
        "tracked_moving": [TrackedCase(0.0, turning=_TURNING, tracker=TRACKER, brief=brief)],
        "untracked_moving": [TrackedCase(0.0, turning=_TURNING, brief=brief)],
    }
    setups = [with_wrong_model(Setup.of(described, seed), STIFFNESS[seed % 2]) for seed in range(1, seeds + 1)]
    jobs = [(key, (setup, case)) for key, of_key in cases.items() for case in of_key for setup in setups]
    outcomes: dict[str, list[TrackedOutcome]] = {key: [] for key in cases}
    found = sweep.map(run_tracked, [job for _, job in jobs], lambda done, total: progress(f"{name} ({done} of {total})"))
    for (key, _), outcome in zip(jobs, found):
        outcomes[key].append(outcome)
    tracked = outcomes["tracked"]
    return name, {
        **{f"{key}_mm": 1e3 * max(outcome.held for outcome in of_key) for key, of_key in outcomes.items()},
        "tracked_pct": 100.0 * max(outcome.held / outcome.released for outcome in tracked),
        "measurements": {"used": sum(o.used for o in tracked), "refused": sum(o.refused for o in tracked)},
    }
