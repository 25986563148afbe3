"""A bag of the running graph as an experiment needs it: tips measured and modelled, gravity, target, and whether it was compensated."""

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gravcomp.calibration.bag import TIP_TOPICS, direction_of_poses, thinned
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.inverse import TargetError, bend_target, straight_target
from gravcomp.inverse.status import ControllerCode
from gravcomp.recordings.bags import BagError
from gravcomp.recordings.bags.streams import CONTROLLER_STATUS, POSE, SHAPE_TARGET, VECTOR, Stream, Wanted, read_streams

RELEASED, HELD, BETWEEN = 0, 1, 2
# A refused target leaves the last one in force.
_KEEPING = (ControllerCode.OK, ControllerCode.AT_LIMIT, ControllerCode.UNREACHABLE, ControllerCode.REFUSED)
_RATE = 100.0  # Hz that are kept of the tip
_WANTED = {
    "tip": Wanted(POSE, TIP_TOPICS),
    "model": Wanted(POSE, ("robot/tip",)),
    "gravity": Wanted(VECTOR, ("gravity",)),
    "status": Wanted(CONTROLLER_STATUS, ("controller/status",)),
    "pose_target": Wanted(POSE, ("target",), optional=True),
    "shape_target": Wanted(SHAPE_TARGET, ("target/shape",), optional=True),
}


@dataclass(frozen=True)
class Course:
    """t samples at the times of the measured tip. SI, soft_base."""

    time: np.ndarray  # (t,) s from the first
    tip_position: np.ndarray  # (t, 3)
    tip_direction: np.ndarray  # (t, 3)
    model_tip_position: np.ndarray  # (t, 3)
    gravity: np.ndarray  # (t, 3) as estimated
    phase: np.ndarray  # (t,) RELEASED, HELD or BETWEEN
    target_position: np.ndarray  # (t, 3)
    target_direction: np.ndarray  # (t, 3)

    def rows(self, which: np.ndarray) -> "Course":
        """Those of a mask or of indices."""
        return Course(*(getattr(self, name)[which] for name in Course.__dataclass_fields__))


@dataclass(frozen=True)
class RecordedRun:
    """`bag`; the setup, of which model, estimator and controller count; and the tip's topic where the user names it."""

    bag: Path
    setup: Setup
    tip_topic: str | None = None

    @functools.cached_property
    def tip(self) -> Stream:
        """Raises ConfigError, as all that reads the bag."""
        return self.streams["tip"]

    @property
    def who(self) -> str:
        """'robot' or 'virtual robot', by whose tip it is."""
        return "virtual robot" if self.tip.topic.endswith("truth/tip") else "robot"

    @property
    def ground(self) -> str:
        """What was judged, for the report."""
        tip = (
            "its true tip stands for a measured one"
            if self.who == "virtual robot"
            else f"its tip as measured on '{self.tip.topic}'"
        )
        return f"A recording of the running graph on the {self.who}, {self.bag.name}; {tip}."

    @functools.cached_property
    def streams(self) -> dict[str, Stream | None]:
        """What `_WANTED` names."""
        wanted = {**_WANTED, "tip": Wanted(POSE, (self.tip_topic,))} if self.tip_topic else _WANTED
        return read(self.bag, wanted)

    @functools.cached_property
    def course(self) -> Course:
        """All at the times of the measured tip."""
        s = self.streams
        order = np.argsort(s["tip"].stamp, kind="stable")
        time, poses = s["tip"].stamp[order], s["tip"].values[order]
        keep = thinned(time, _RATE)
        for name in ("model", "gravity"):
            keep &= (time >= s[name].stamp.min()) & (time <= s[name].stamp.max())
        time, poses = time[keep], poses[keep]
        if len(time) < 2:
            raise ConfigError(f"{self.bag}: the tips of '{s['tip'].topic}' and of the model do not overlap in time")
        position, direction = self._targets(time)
        return Course(
            time=time - time[0],
            tip_position=poses[:, :3],
            tip_direction=direction_of_poses(poses),
            model_tip_position=s["model"].at(time)[:, :3],
            gravity=s["gravity"].at(time),
            phase=self._phases(time),
            target_position=position,
            target_direction=direction,
        )

    def _phases(self, time: np.ndarray) -> np.ndarray:
        """By the controller's last word, whose stamps may be missing while nothing drives it."""
        status = self.streams["status"]
        code = status.values[:, 0].astype(int)
        phases = np.where(np.isin(code, _KEEPING), HELD, np.where(code == ControllerCode.RELAXING, RELEASED, BETWEEN))
        return _last(time, status.received, phases[:, None], np.array([BETWEEN]))[:, 0].astype(int)

    def _targets(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and directions (t, 3): straight until something else was asked for."""
        length = self.setup.robot.length
        straight = straight_target(length)
        received, rows = [], []
        for name in ("pose_target", "shape_target"):
            stream = self.streams[name]
            for moment, values in zip(stream.received, stream.values) if stream else ():
                try:
                    rows.append(_pose_target(values) if name == "pose_target" else _shape_target(values, length))
                    received.append(moment)
                except TargetError:  # the controller refused it, too
                    continue
        order = np.argsort(received, kind="stable")
        first = np.concatenate([straight.tip_position, straight.tip_direction])
        targets = _last(time, np.array(received)[order], np.array(rows).reshape(-1, 6)[order], first)
        return targets[:, :3], targets[:, 3:]


def read(bag: Path, wanted: dict[str, Wanted]) -> dict[str, Stream | None]:
    """`read_streams` whose errors are those of a command. Raises ConfigError."""
    try:
        return read_streams(bag, wanted)
    except BagError as error:
        raise ConfigError(str(error)) from error


def _last(time: np.ndarray, known: np.ndarray, values: np.ndarray, first: np.ndarray) -> np.ndarray:
    """(t, n) the last of the values (k, n) that was known (k,) at each time; `first` (n,) before all."""
    return np.vstack([first, values])[np.searchsorted(known, time, side="right")]


def _pose_target(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values[:3], direction_of_poses(values[None, :])[0]])


def _shape_target(values: np.ndarray, length: float) -> np.ndarray:
    bend, angle, plane, *points = values
    if bend:
        target = bend_target(length, angle, plane)
        return np.concatenate([target.tip_position, target.tip_direction])
    direction = np.array(points[3:])
    norm = np.linalg.norm(direction)
    # Where no direction is asked for, lateral means across the robot's own axis at rest.
    return np.concatenate([points[:3], direction / norm if norm > 0.0 else [0.0, 0.0, 1.0]])
