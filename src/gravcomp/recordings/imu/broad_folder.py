"""Folder of the BROAD benchmark's recordings on this machine."""

import os
from pathlib import Path

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
