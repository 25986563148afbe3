"""Where recordings of the BROAD benchmark lie on this machine."""

import os
from pathlib import Path

WHERE = (
    "BROAD (D. Laidig et al., Data 2021, 6(7), 72; CC BY 4.0) is at https://github.com/dlaidig/broad. Put its trials as .npz files with gyr, acc, "
    "quat, movement, rate into a folder 'broad' and point the environment variable GRAVCOMP_DATA to the folder around it."
)


def broad_files() -> list[Path]:
    """The .npz trials in $GRAVCOMP_DATA/broad, else in ../shared/data/broad beside the repository; empty when there are none."""
    root = os.environ.get("GRAVCOMP_DATA")
    # src/gravcomp/recordings/imu/THIS -> the repository's folder
    folder = Path(root) if root else Path(__file__).resolve().parents[4].parent / "shared" / "data"
    return sorted((folder / "broad").glob("*.npz"))
