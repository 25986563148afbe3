"""A calibration on a running robot, pose by pose: what to do, whether it is done, and the samples of each rest.

    turn    the base is turned by hand until gravity is as planned and steady
    pull    the cables move to the planned displacements, within their limits
    rest    the robot is given its time; the samples since the turn ended are kept
    done    all poses are measured

Each finished pose is added to a CSV file in the form of `files`. A session that finds such a file goes on after its last pose.
After a pause the course begins again: a new trial, whose robot counts as relaxed. Poses that cannot be written, because the disk
is full, are kept while the session goes on, and written as soon as there is room.

Tips that cannot be of this robot are not taken, and `sentence` says why: another clock, other units, no numbers. Each row has the
length of the specific force of its time, or nothing where the IMU gives none.
"""

import csv
import enum
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gravcomp.calibration.approach import approached
from gravcomp.calibration.bag import SAME_CLOCK, another_clock
from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.files import FORCE, csv_header, csv_row
from gravcomp.calibration.measured import MeasurementError, StillWindows
from gravcomp.calibration.plan import Plan, PlannedPose
from gravcomp.calibration.plan_table import instruction
from gravcomp.calibration.plausible import check_units
from gravcomp.config import parameter
from gravcomp.description import Robot
from gravcomp.whole_file import write_whole


@dataclass(frozen=True)
class LiveOptions:
    """When a pose counts as reached."""

    turned: float = parameter(8.0, edge="deg", minimum=0.5, maximum=45.0, description="farthest from the planned gravity")
    steady: float = parameter(0.5, edge="deg", minimum=0.01, maximum=10.0, description="largest turn of a base held still")
    hold: float = parameter(1.0, unit="s", minimum=0.1, maximum=30.0, description="time for which it has to be still")


class Phase(enum.StrEnum):
    """What a session waits for."""

    TURN = "turn"
    PULL = "pull"
    REST = "rest"
    DONE = "done"


_ANOTHER = "is not of this robot and plan; name another file to begin again"


class LiveSession:
    """One calibration. Times in s of any clock that does not jump; all else in SI and soft_base.

    unwritten: why the measured poses are not in the file, empty where they are.
    """

    def __init__(self, robot: Robot, plan: Plan, path: Path):
        """Begin, or go on with the file at `path`. Raises MeasurementError for a file of another robot or plan."""
        self._robot, self._plan, self._path, self._options = robot, plan, path, LiveOptions()
        self._forced = True  # a file of an earlier release has no column of the specific force
        self._pose, self._trial = self._progress()
        self.phase = Phase.TURN if self._pose < len(plan.poses) else Phase.DONE
        self._gravities: list[tuple[float, np.ndarray]] = []
        self._force: tuple[float, float] | None = None  # time in s and length in m/s^2
        self._rows: list[list] = []
        self._pending: list[list] = []  # rows of finished poses that are not in the file
        self.unwritten, self._refused = "", ""
        self._command: np.ndarray | None = None
        self._since = math.nan
        self._commanded_at = math.nan

    @property
    def pose(self) -> PlannedPose | None:
        """The pose that is being measured; None when all are."""
        return self._plan.poses[self._pose] if self._pose < len(self._plan.poses) else None

    @property
    def finished(self) -> int:
        """Number of poses that are measured."""
        return self._pose

    def sentence(self) -> str:
        """Return what to do, or what is happening."""
        kept = (
            f"{self.unwritten}; the poses since then are kept, and written as soon as that is possible. "
            if self.unwritten
            else ""
        )
        pose = self.pose
        if pose is None:
            return kept or f"all {len(self._plan.poses)} poses are measured: {self._path}"
        place = f"{kept}pose {self._pose + 1} of {len(self._plan.poses)}"
        if self.phase == Phase.TURN:
            away = "" if not self._gravities else f", about {5 * round(self._degrees_away() / 5)} deg away"
            return f"{place}: hold the base with its {instruction(pose)}{away}"
        if self._refused:
            return f"{place}: the tip is not taken: {self._refused}"
        if self.phase == Phase.PULL:
            return f"{place}: hold still, the cables move"
        if not self._rows and self._gravities[-1][0] - self._since > self._plan.rest:
            return f"{place}: hold still; no measured tip arrives"
        return f"{place}: hold still, measuring"

    def on_gravity(self, time: float, gravity: np.ndarray) -> None:
        """Take gravity (3,). A base that leaves the pose begins it again; what is no direction is left out."""
        if not np.isfinite(gravity).all() or not gravity.any():
            return
        self._gravities = [(t, g) for t, g in self._gravities if t >= time - self._options.hold] + [(time, gravity)]
        if self.phase == Phase.DONE:
            return
        reached = self._away(gravity) <= self._options.turned
        if self.phase == Phase.TURN:
            whole = self._gravities[-1][0] - self._gravities[0][0] >= 0.9 * self._options.hold
            if reached and whole and self._spread() <= self._options.steady:
                self.phase, self._since = Phase.PULL, time
        elif not reached:
            self.phase, self._rows = Phase.TURN, []

    def on_force(self, time: float, force: np.ndarray) -> None:
        """Take the specific force (3,) by the IMU in m/s^2; what is no number is left out."""
        if np.isfinite(force).all():
            self._force = time, float(np.linalg.norm(force))

    def command(self, time: float, present: np.ndarray) -> np.ndarray | None:
        """Return the displacements (m,) to send now, from the `present` ones on; None: send nothing."""
        pose = self.pose
        if pose is None:
            return None
        if self._command is None:
            self._command, self._commanded_at = present.copy(), time
        interval = min(max(time - self._commanded_at, 0.0), 0.1)
        self._commanded_at = time
        wanted = self._command if self.phase == Phase.TURN else pose.displacement
        self._command = approached(wanted, self._command, self._robot.limits, interval)
        if self.phase == Phase.PULL and np.abs(self._command - pose.displacement).max(initial=0.0) < 1e-9:
            self.phase, self._since = Phase.REST, time
        return self._command

    def on_tip(self, time: float, position: np.ndarray, direction: np.ndarray) -> None:
        """Take a measured tip; at the end of its time the pose is finished, and the next one begins."""
        if self.phase not in (Phase.PULL, Phase.REST) or self._command is None or not self._gravities:
            return
        self._refused = self._wrong(time, position, direction)
        if self._refused:
            return
        gravity = self._gravities[-1][1]
        self._rows.append(csv_row(self._trial, time, gravity, self._command, position, direction, self._length_at(time)))
        if self.phase == Phase.REST and time - self._since >= self._plan.rest:
            self._finish()

    def save(self) -> bool:
        """Write the finished poses that are not in the file; return whether all of them are. `unwritten` says why not."""
        if not self._pending:
            return True
        text = io.StringIO()
        writer = csv.writer(text)
        try:
            if self._path.exists():
                with self._path.open(newline="", encoding="utf-8-sig") as file:
                    text.write(file.read())
            else:
                writer.writerow(self._header)
            writer.writerows(self._pending)
            write_whole(self._path, text.getvalue(), lasting=True)
        except OSError as error:
            self.unwritten = f"{self._path} cannot be written: {error.strerror}"
            return False
        self._pending, self.unwritten = [], ""
        return True

    @property
    def _header(self) -> list[str]:
        return ["pose", *csv_header(self._robot.cable_names, directed=True), *[FORCE] * self._forced]

    def _length_at(self, time: float) -> float | None:
        """Return the length of the specific force, NaN where the last one is of another time; None: the file has none."""
        if not self._forced:
            return None
        if self._force is None or abs(time - self._force[0]) > SAME_CLOCK:
            return math.nan
        return self._force[1]

    def _wrong(self, time: float, position: np.ndarray, direction: np.ndarray) -> str:
        """Return why a tip cannot be of this robot, empty where it can."""
        if not np.isfinite([time, *position, *direction]).all():
            return "it has values that are not finite numbers"
        now, gravity = self._gravities[-1]
        if abs(time - now) > SAME_CLOCK:
            return another_clock(time - now, time, "measured/tip")
        assert self._command is not None
        try:
            check_units(self._robot, StillWindows(gravity[None], self._command[None], position[None]), "measured/tip")
        except MeasurementError as error:
            return str(error)
        return ""

    def _finish(self) -> None:
        self._pending += [[self._pose + 1, *row] for row in self._rows]
        self._pose, self._rows, self._since = self._pose + 1, [], math.nan
        pose, last = self.pose, self._plan.poses[self._pose - 1]
        if pose is None:
            self.phase = Phase.DONE
        else:
            self.phase = Phase.PULL if pose.station == last.station else Phase.TURN
        self.save()

    def _progress(self) -> tuple[int, int]:
        """Return the number of poses in the file, and the number of the next trial."""
        if not self._path.exists():
            return 0, 0
        table = CsvTable.read(self._path)
        self._forced = FORCE in table.header
        if list(table.header) != self._header:
            raise MeasurementError(f"{self._path}: {_ANOTHER}")
        done, trial = (int(table.numbers(name).max(initial=-1.0)) for name in ("pose", "trial"))
        if max(done, 0) > len(self._plan.poses):
            raise MeasurementError(f"{self._path}: {_ANOTHER}")
        return max(done, 0), trial + 1

    def _away(self, gravity: np.ndarray) -> float:
        """Return the angle in rad between gravity and the planned one."""
        pose = self.pose
        assert pose is not None
        one, other = gravity / np.linalg.norm(gravity), pose.gravity / np.linalg.norm(pose.gravity)
        return float(np.arccos(np.clip(one @ other, -1.0, 1.0)))

    def _degrees_away(self) -> float:
        return math.degrees(self._away(self._gravities[-1][1]))

    def _spread(self) -> float:
        """Return by how much gravity turned within the time of `hold`, in rad."""
        units = np.array([g / np.linalg.norm(g) for _, g in self._gravities])
        return float(np.arccos(np.clip(units @ units[-1], -1.0, 1.0)).max())
