"""Reading of .npz files in the layout of the BROAD benchmark.

D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - A Benchmark for Robust Inertial Orientation Estimation", Data 2021, 6(7), 72.
Arrays: `gyr` rad/s (N, 3), `acc` m/s^2 (N, 3), `rate` Hz; where known `quat` w x y z sensor to earth (N, 4, NaN where
occluded) and `movement` bool (N,), the samples that count in the evaluation of a filter.
"""

import zipfile
from pathlib import Path

import numpy as np

from gravcomp.recordings.imu.recording import Recording, RecordingError

_SLOWEST, _FASTEST = 0.1, 100e3  # Hz

LAYOUT = "needed: gyr (N, 3) rad/s, acc (N, 3) m/s^2, rate in Hz; optional: quat (N, 4), movement (N,)"


def read_broad(path: str | Path) -> Recording:
    """Return the recording in the file. Raises RecordingError for a file that is not in this layout."""
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise RecordingError(f"{path}: contains a single array; {LAYOUT}")
            arrays = {name: file[name] for name in ("gyr", "acc", "rate", "quat", "movement") if name in file.files}
            found = ", ".join(file.files) or "nothing"
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise RecordingError(f"{path}: is not an .npz file of plain arrays") from error

    missing = [name for name in ("gyr", "acc", "rate") if name not in arrays]
    if missing:
        raise RecordingError(f"{path}: lacks {', '.join(missing)} (found: {found}); {LAYOUT}")
    gyro = _columns(arrays["gyr"], 3, "gyr", path)
    accel = _columns(arrays["acc"], 3, "acc", path)
    if len(gyro) != len(accel):
        raise RecordingError(f"{path}: gyr has {len(gyro)} samples, acc has {len(accel)}; equally many are needed")
    rate = _rate(arrays["rate"], path)
    movement = arrays.get("movement")
    if movement is not None and movement.dtype != bool and not np.isin(movement, (0, 1)).all():
        raise RecordingError(f"{path}: movement is {movement.dtype} with other values than 0 and 1; booleans are needed")
    return Recording(
        source=str(path),
        stamp_ns=np.rint(np.arange(len(gyro)) * (1e9 / rate)).astype(np.int64),
        gyro=gyro,
        accel=accel,
        orientation=_columns(arrays["quat"], 4, "quat", path) if "quat" in arrays else None,
        movement=None if movement is None else movement.astype(bool),
    )


def _columns(values: np.ndarray, width: int, name: str, path: Path) -> np.ndarray:
    if values.ndim != 2 or values.shape[1] != width:
        raise RecordingError(f"{path}: {name} has the shape {values.shape}; (N, {width}) is needed")
    if values.dtype.kind not in "fiu":
        raise RecordingError(f"{path}: {name} is of type {values.dtype}; numbers are needed")
    return values.astype(float)


def _rate(value: np.ndarray, path: Path) -> float:
    if value.size != 1 or value.dtype.kind not in "fiu" or not _SLOWEST <= value.item() <= _FASTEST:
        allowed = f"one number of {_SLOWEST:g} to {_FASTEST:g} Hz is needed"
        raise RecordingError(f"{path}: rate is {np.array2string(value, threshold=4)}; {allowed}")
    return float(value.item())
