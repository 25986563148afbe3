"""The BROAD benchmark's recordings on this machine."""

import os
from pathlib import Path

from gravcomp.recordings.imu.reading import read_recording
from gravcomp.recordings.imu.recording import Recording

_BEGINNING = 60.0  # s: rest, and some of the motion

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
    """Return every `every`-th trial by its name; for more than 1 only the first minute of each. Raises RecordingError."""
    trials = {file.stem: read_recording(file) for file in broad_files()[::every]}
    return {name: trial.beginning(_BEGINNING) for name, trial in trials.items()} if every > 1 else trials
