"""When the anchored model predicts in place of the running one, and what it is asked for.

It takes over where the running model's tip is far from a tip that was measured lately. Who computes it is left to a `Worker`:
either it answers at once, for results that do not depend on the machine, or a process of its own answers some samples later
(`anchored_process`), so that nothing waits for it.
"""

from typing import NamedTuple, Protocol

import numpy as np

from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.shape import Shape
from gravcomp.full_model.wrench import Wrench
from gravcomp.load_estimation.anchored_model import NEAR, AnchoredModel, AnchoredShape
from gravcomp.mesh.mesh import MeshError
from gravcomp.scene.scene import Scene

_FAR = 0.1  # of the length: a model whose tip is farther from the measured one is no measure of the load
_LONGEST = 2.0  # s between two steps: a body that creeps has relaxed by then


class Question(NamedTuple):
    """A sample: stamp in s, measured tip (3,) m, gravity (3,) m/s^2, the cables wound (m,) m, and known wrenches."""

    stamp: float
    place: np.ndarray
    gravity: np.ndarray
    wound: np.ndarray
    known: tuple[Wrench, ...]


class Answer(NamedTuple):
    """What the anchored model found for a question: None while it is on its way to the tip."""

    question: Question
    found: AnchoredShape | None

    @property
    def off(self) -> np.ndarray:
        """The way (3,) in m from the model's tip to the measured one. A shape was found."""
        assert self.found is not None
        return self.question.place - self.found.shape.tip_position


class Worker(Protocol):
    """Computes the anchored model."""

    def exchange(self, question: Question) -> list[Answer]:
        """Return what has been computed since the last call, and compute this question, unless another one is being computed."""

    def reset(self) -> None:
        """Forget the robot's shape, and answers that have not been returned."""

    def close(self) -> None:
        """End."""

    @property
    def sentence(self) -> str:
        """What the user has to know, empty while all is well."""


class AtOnce:
    """A worker that computes in the call."""

    sentence = ""

    def __init__(self, model: AnchoredModel):
        self._model = model
        self._last = -np.inf

    def exchange(self, question: Question) -> list[Answer]:
        """Return the answer to this question."""
        elapsed = question.stamp - self._last
        self._last = question.stamp
        self._model.anchor(question.place)
        duration = elapsed if 0.0 < elapsed <= _LONGEST else None
        return [Answer(question, self._model.step(question.gravity, question.wound, question.known, duration))]

    def reset(self) -> None:
        """Forget the robot's shape."""
        self._model.reset()
        self._last = -np.inf

    def close(self) -> None:
        """Do nothing."""


class AnchoredFollower:
    """Follows the measured tip of one robot."""

    def __init__(self, worker: Worker, length: float, stale_after: float):
        """length in m, of the robot; stale_after in s: a tip that was measured longer ago holds nothing."""
        self._worker, self._stale_after = worker, stale_after
        self.near, self.far = NEAR * length, _FAR * length
        self.reset()

    def reset(self) -> None:
        """Forget where the tip is."""
        self._place, self._newest = np.zeros(3), -np.inf
        self.measured_at = -np.inf  # s, stamp of the measured tip
        self._worker.reset()

    def anchor(self, stamp: float, place: np.ndarray) -> None:
        """Take a measured tip (3,) m at its stamp (s), unless it is older than the last one or of another clock."""
        # A model that is on its way to the tip predicts nothing, and has to know where the tip is now.
        if self.measured_at <= stamp and abs(self._newest - stamp) <= self._stale_after:
            self._place, self.measured_at = np.array(place), stamp

    def takes_over(self, stamp: float, shape: Shape) -> bool:
        """Return whether `shape` of the running model at a stamp (s) is far from a tip that was measured lately."""
        if stamp < self._newest:  # a replay has restarted
            self.measured_at = -np.inf
        self._newest = stamp
        if stamp - self.measured_at > self._stale_after:
            return False
        return not shape.is_equilibrium or bool(np.linalg.norm(self._place - shape.tip_position) > self.far)

    def step(self, gravity: np.ndarray, wound: np.ndarray, known: tuple[Wrench, ...]) -> list[Answer]:
        """Go on at the newest stamp under gravity (3,), with the cables wound (m,); return the shapes that were found since."""
        answers = self._worker.exchange(Question(self._newest, self._place, gravity, wound, known))
        # An answer of before a replay has restarted has a stamp that is still to come.
        return [answer for answer in answers if answer.found is not None and answer.question.stamp <= self._newest]

    @property
    def sentence(self) -> str:
        """What the user has to know, empty while all is well."""
        return self._worker.sentence

    def close(self) -> None:
        """End what computes."""
        self._worker.close()


def has_anchored_model(model: RobotModel, kind: str) -> bool:
    """Return whether a load of a kind of `LoadEstimationOptions` needs an anchored model, and the body allows one.

    Shapes of the running model do for a payload, and have to for bodies that have no cross-sections.
    """
    try:
        model.section_rows(1.0)
    except MeshError:
        return False
    return kind == "force"


def at_once(model: RobotModel, kind: str, scene: Scene | None = None) -> AtOnce | None:
    """Return a worker in this process, if there is a model for it (`has_anchored_model`). scene: what the robot touches."""
    return AtOnce(AnchoredModel(model, scene)) if has_anchored_model(model, kind) else None
