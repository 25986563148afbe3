"""A bag of the running graph, read for an evaluation."""

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gravcomp.calibration.bag import TIP_TOPICS, direction_of_poses, thinned
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError
from gravcomp.evaluation.recorded.course import BETWEEN, HELD, RELEASED, Course, last_known
from gravcomp.evaluation.recorded.targets import targets_over
from gravcomp.inverse.status import ControllerCode
from gravcomp.recordings.bags import BagError
from gravcomp.recordings.bags.streams import CONTROLLER_STATUS, POSE, SHAPE_TARGET, VECTOR, Stream, Wanted, read_streams

# When a target is refused, the last one stays in force.
_KEEPING = (
    ControllerCode.OK, ControllerCode.AT_LIMIT, ControllerCode.UNREACHABLE, ControllerCode.CONTACT, ControllerCode.ZONE,
    ControllerCode.REFUSED,
)  # fmt: skip
_RATE = 100.0  # Hz, largest rate of the tip that is kept
_WANTED = {
    "tip": Wanted(POSE, TIP_TOPICS),
    "model": Wanted(POSE, ("robot/tip",)),
    "gravity": Wanted(VECTOR, ("gravity",)),
    "status": Wanted(CONTROLLER_STATUS, ("controller/status",)),
    "pose_target": Wanted(POSE, ("target",), optional=True),
    "shape_target": Wanted(SHAPE_TARGET, ("target/shape",), optional=True),
}


@dataclass(frozen=True)
class RecordedRun:
    """A recorded run: bag, setup (its model, estimator and controller are used), and the tip's topic if the user names it.

    All properties that read the bag raise ConfigError.
    """

    bag: Path
    setup: Setup
    tip_topic: str | None = None

    @property
    def tip(self) -> Stream:
        """The measured tip."""
        return required(self.streams, "tip")

    @property
    def who(self) -> str:
        """'robot' or 'virtual robot', by the topic of the tip."""
        return "virtual robot" if self.tip.topic.endswith("truth/tip") else "robot"

    @property
    def ground(self) -> str:
        """What was evaluated, for the report."""
        tip = (
            "its true tip stands for a measured one"
            if self.who == "virtual robot"
            else f"its tip as measured on '{self.tip.topic}'"
        )
        return f"A recording of the running graph on the {self.who}, {self.bag.name}; {tip}."

    @functools.cached_property
    def streams(self) -> dict[str, Stream | None]:
        """The topics that `_WANTED` names."""
        wanted = {**_WANTED, "tip": Wanted(POSE, (self.tip_topic,))} if self.tip_topic else _WANTED
        return read(self.bag, wanted)

    @functools.cached_property
    def course(self) -> Course:
        """All values at the times of the measured tip."""
        model, gravity = required(self.streams, "model"), required(self.streams, "gravity")
        order = np.argsort(self.tip.stamp, kind="stable")
        time, poses = self.tip.stamp[order], self.tip.values[order]
        keep = thinned(time, _RATE)
        for stream in (model, gravity):
            keep &= (time >= stream.stamp.min()) & (time <= stream.stamp.max())
        time, poses = time[keep], poses[keep]
        if len(time) < 2:
            raise ConfigError(f"{self.bag}: the tips of '{self.tip.topic}' and of the model do not overlap in time")
        position, direction = targets_over(time, self.streams["pose_target"], self.streams["shape_target"], self.setup.robot)
        return Course(
            time=time - time[0],
            tip_position=poses[:, :3],
            tip_direction=direction_of_poses(poses),
            model_tip_position=model.at(time)[:, :3],
            gravity=gravity.at(time),
            phase=self._phases(time),
            target_position=position,
            target_direction=direction,
        )

    def _phases(self, time: np.ndarray) -> np.ndarray:
        """Return the phases (t,) from the last status; by reception, because its stamp is empty while no gravity arrives."""
        status = required(self.streams, "status")
        code = status.values[:, 0].astype(int)
        phases = np.where(np.isin(code, _KEEPING), HELD, np.where(code == ControllerCode.RELAXING, RELEASED, BETWEEN))
        return last_known(time, status.received, phases[:, None], np.array([BETWEEN]))[:, 0].astype(int)


def read(bag: Path, wanted: dict[str, Wanted]) -> dict[str, Stream | None]:
    """Return the streams of `read_streams`. Raises ConfigError instead of BagError."""
    try:
        return read_streams(bag, wanted)
    except BagError as error:
        raise ConfigError(str(error)) from error


def required(streams: dict[str, Stream | None], key: str) -> Stream:
    """Return a stream that is not optional."""
    stream = streams[key]
    assert stream is not None, key  # `read_streams` raises for a missing one
    return stream
