"""The BROAD benchmark's recordings on this machine."""

import os
from pathlib import Path

import numpy as np

from gravcomp.recordings.imu.reading import read_recording
from gravcomp.recordings.imu.recording import Recording

# s, of a part of a trial: before its first motion, in which the filter settles; from it on, in which all axes turn.
_REST, _MOTION = 15.0, 20.0

WHERE = (
    "BROAD (D. Laidig et al., Data 2021, 6(7), 72; CC BY 4.0) is at https://github.com/dlaidig/broad."
    " Put its trials as .npz files with gyr, acc, quat, movement, rate into a folder 'broad'"
    " and set the environment variable GRAVCOMP_DATA to its parent folder."
)


def broad_files() -> list[Path]:
    """Return the .npz trials in $GRAVCOMP_DATA/broad, by default in ../shared/data/broad next to the repository."""
    root = os.environ.get("GRAVCOMP_DATA")
    # src/gravcomp/recordings/imu/THIS -> folder of the repository
    folder = Path(root) if root else Path(__file__).resolve().parents[4].parent / "shared" / "data"
    return sorted((folder / "broad").glob("*.npz"))


def broad_trials(every: int = 1) -> dict[str, Recording]:
    """Return every `every`-th trial by its name; for more than 1 only a part of each around its first motion.

    Raises RecordingError.
    """
    trials = {file.stem: read_recording(file) for file in broad_files()[::every]}
    return {name: around_first_motion(trial) for name, trial in trials.items()} if every > 1 else trials


def around_first_motion(trial: Recording) -> Recording:
    """Return the end of the rest with which a trial begins, and the beginning of its motion.

    Of a recording that does not say when it moves, as all of BROAD do, it is the beginning.
    """
    moving = trial.movement
    first = _REST if moving is None else 1e-9 * float(trial.stamp_ns[np.argmax(moving)] - trial.stamp_ns[0])
    return trial.between(first - _REST, first + _MOTION)
