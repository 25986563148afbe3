"""Recordings of a silicone beam that a hand releases, and what they show without a model."""

import dataclasses
import re
from pathlib import Path

import numpy as np

from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.measured import MeasurementError

_KIND = re.compile(r"gravity|load(?P<grams>\d+)")  # how the name of a file begins
_QUIET = 2.0  # s after the release, when the beam no longer swings
_REST = 1.0  # s at the end, in which it rests
_HAND = 0.1  # s before the release, in which the hand may already move
_RIGID = 1e-3  # m by which a distance between markers may differ from its median: ten times the error of a marker


@dataclasses.dataclass(frozen=True)
class Recording:
    """One recording. mass of the weight in kg; time (t,) in s from the release; markers (t, 3, 3) in m, `held` (3, 3): before.

    mistaken: number of instants that are left out, as the markers are not as far from each other there as they are otherwise.
    """

    name: str
    mass: float
    time: np.ndarray
    markers: np.ndarray
    held: np.ndarray
    mistaken: int = 0

    @property
    def rest(self) -> np.ndarray:
        """Mean places (3, 3) of the markers in the last second."""
        return self.markers[self.time > self.time[-1] - _REST].mean(axis=0)

    @property
    def rest_time(self) -> float:
        """Time in s from the release to the middle of the last second."""
        return float(self.time[-1]) - 0.5


def read(path: Path) -> Recording:
    """Read a recording. Raises MeasurementError."""
    kind = _KIND.match(path.stem)
    if kind is None:
        raise MeasurementError(f"{path}: the name begins with neither gravity nor load and the grams of the weight, as load52")
    table = CsvTable.read(path)
    names = [f"tip{i}_{axis}_mm" for i in (1, 2, 3) for axis in "xyz"]
    table.require(["time_s", *names])
    time = table.numbers("time_s")
    order = np.argsort(time, kind="stable")
    time, markers = time[order], table.vectors(names, 1e-3)[order].reshape(-1, 3, 3)
    if not len(time):
        raise MeasurementError(f"{path}: contains no rows below its header")
    whole = _rigid(markers)
    if 2 * whole.sum() < len(whole):
        raise MeasurementError(
            f"{path}: the markers do not keep their distances: at {(~whole).sum()} of {len(whole)} instants one differs by more"
            f" than {1e3 * _RIGID:g} mm from its median. Are tip1 to tip3 fixed to the free face?"
        )
    time, markers = time[whole], markers[whole]
    height = markers[:, :, 0].mean(axis=1)
    fallen = np.flatnonzero(height < height[:10].mean() - 2e-3)
    if not len(fallen):
        raise MeasurementError(f"{path}: the markers never fall by 2 mm")
    release = float(time[fallen[0]] - np.sqrt(2 * 2e-3 / 9.81))
    before, after = time < release - _HAND, time[-1] - release
    if not before.any() or after < _QUIET + _REST:
        raise MeasurementError(
            f"{path}: begins {release - time[0]:.2f} s before the release and ends {after:.2f} s after it;"
            f" needed: more than {_HAND:g} s and at least {_QUIET + _REST:g} s"
        )
    held = markers[before].mean(axis=0)
    return Recording(path.stem, 1e-3 * float(kind["grams"] or 0), time - release, markers, held, int((~whole).sum()))


def _rigid(markers: np.ndarray) -> np.ndarray:
    """Return at which instants (t,) the markers (t, 3, 3) are as far from each other as they are otherwise."""
    distance = np.linalg.norm(markers - np.roll(markers, 1, axis=1), axis=2)
    return np.asarray((np.abs(distance - np.median(distance, axis=0)) < _RIGID).all(axis=1))


@dataclasses.dataclass(frozen=True)
class Swing:
    """The free swing after the release.

    frequency in Hz; decay rate in 1/s; turn of the face in the plane of bending over its height in rad/m; creep: part of the
    travel that is added while the time grows by the factor e, once the beam no longer swings.
    """

    frequency: float
    decay: float
    turn: float
    creep: float

    @property
    def loss(self) -> float:
        """Loss factor: what a radian of the swing loses of its energy."""
        return self.decay / (np.pi * self.frequency)


def swing(recording: Recording) -> Swing:
    """Return the free swing of the markers' mean, of the face's turn against its height, and the slow creep that follows."""
    within = (recording.time > 0.1) & (recording.time < 1.5)
    moved = 1e3 * (recording.markers - recording.rest).mean(axis=1)[:, 0]
    frequency, decay = _decaying(recording.time[within], moved[within])
    turns = np.array([turn_in_plane(recording.rest, markers) for markers in recording.markers[within]])
    turn = float(np.polyfit(1e-3 * moved[within], turns, 1)[0])
    late = recording.time > _QUIET
    slope = 1e-3 * float(np.polyfit(np.log(recording.time[late]), moved[late], 1)[0])
    return Swing(frequency, decay, turn, slope / float((recording.rest - recording.held).mean(axis=0)[0]))


def turn_in_plane(before: np.ndarray, after: np.ndarray) -> float:
    """Return the turn in rad about y from markers `before` (3, 3) to `after`, by least squares."""
    from scipy.spatial.transform import Rotation

    rotation, _ = Rotation.align_vectors(after - after.mean(axis=0), before - before.mean(axis=0))
    return float(rotation.as_rotvec()[1])


def hand_turn(recording: Recording, free: Swing) -> float:
    """Return by how many rad about y the hand turned the face.

    While the beam swings freely, the turn of its face belongs to its height. What the face turns more from the hand to rest is
    the hand's.
    """
    travel = float((recording.rest - recording.held).mean(axis=0)[0])
    return free.turn * travel - turn_in_plane(recording.held, recording.rest)


def _decaying(time: np.ndarray, height: np.ndarray) -> tuple[float, float]:
    """Return the frequency in Hz and the decay rate in 1/s of a swing that decays."""
    from scipy.optimize import least_squares

    frequencies = np.linspace(2.0, 15.0, 521)
    power = [abs(height @ np.exp(-2j * np.pi * f * time)) for f in frequencies]
    start = [1.0, 1.0, 0.0, 2 * np.pi * frequencies[int(np.argmax(power))], 2.0]

    def residuals(x: np.ndarray) -> np.ndarray:
        envelope = np.exp(-x[4] * time)
        return envelope * (x[0] * np.cos(x[3] * time) + x[1] * np.sin(x[3] * time)) + x[2] - height

    found = least_squares(residuals, start)
    return abs(float(found.x[3])) / (2 * np.pi), float(found.x[4])
