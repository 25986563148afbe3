"""The observer: compares measured tips with what the model predicted for their time, and corrects targets by the model's error.

    observer.predict(stamp, tip_position, tip_orientation, response, tension)     # each shape of the model
    observer.measure(stamp, arrival, frame, position)                             # each measurement, whenever it comes
    observer.corrected(target, stamp)                                             # the target that the model has to reach

The controller brings the model to the corrected target: the target minus the estimated error. So the error does not enter the
model, and the fast loop over the IMU stays as it is. Before the first accepted measurement `corrected` returns the target itself.
"""

import collections
import dataclasses
import enum
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.description import Robot
from gravcomp.first_order_lag import lag_share
from gravcomp.inverse import Target
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.tip_observer.causes import wild, wrong_axes, wrong_stamp
from gravcomp.tip_observer.error_filter import GATE, ErrorFilter
from gravcomp.tip_observer.history import History, Prediction
from gravcomp.tip_observer.load_change import LoadChange
from gravcomp.tip_observer.motion_check import Disagreement, MotionCheck
from gravcomp.tip_observer.options import TipObserverOptions

if TYPE_CHECKING:
    from gravcomp.full_model.shape import Response

_WINDOW = 40  # measurements whose motion is compared with the model's
_LEAST = 8  # of them
_REFUSED = 3  # refusals in a row after which the status says so
_SHIFTED = 6  # outliers in a row that agree with each other: the tracker or the load has changed
_FROZEN = 3  # equal positions in a row: a tracker that repeats its last pose
# The model's error may change by this share of a change of the load: hysteresis, cable friction.
_HYSTERESIS = 0.03


class TrackerState(enum.StrEnum):
    """What becomes of the measurements."""

    NONE = "no measurement"
    USED = "used"
    REFUSED = "refused"
    STALE = "stale"


@dataclasses.dataclass(frozen=True)
class TrackerStatus:
    """State of the tracker.

    sentence: empty while all is well; offset (3,) in m: the robot's tip minus the model's, as applied; used, refused: counts.

    restarts: how often the estimate began again, because the tracker or the load had changed.
    """

    state: TrackerState
    sentence: str
    offset: np.ndarray
    used: int
    refused: int
    restarts: int


class TipObserver:
    """Estimates the model's error at the tip. One object for one robot."""

    def __init__(self, robot: Robot, options: TipObserverOptions | None = None, base_frame: str = "soft_base"):
        """options: default `TipObserverOptions()`; base_frame: frame of the model's shapes."""
        self._length, self._base_frame = robot.length, base_frame
        self._rest_tip = rest_tip(robot)[0]
        options = options or TipObserverOptions()
        self.configure(options)

    def configure(self, options: TipObserverOptions) -> None:
        """Begin again with these options."""
        self.options = options
        self._turn = Rotation.from_euler("xyz", options.rpy)
        self._history = History(options.longest_delay + options.delay + options.response)
        self._used = self._refused = self._restarts = 0
        self._applied, self._applied_at = np.zeros(3), -np.inf
        self._followed = np.zeros(3)  # m, what the model has moved by the correction; none where it leans on an obstacle
        self._last_used = self._last_stamp = self._last_refused = -np.inf
        self._refusal, self._in_a_row = "", 0
        self._largest_sag = 0.0
        self._motion = MotionCheck(self._length, options.std, options.response)
        self._agreed: ErrorFilter | None = None  # estimate while measured and modelled tip moved alike
        self._equal, self._last_position = 0, np.full(3, np.nan)
        self._restart()

    def _restart(self) -> None:
        """Forget the estimate."""
        self._filter = ErrorFilter(0.1 * self._allowed, self.options.model_error)
        self._before: Prediction | None = None  # of the last accepted measurement
        self._by_gravity, self._by_cables = LoadChange(self.options.std), LoadChange(self.options.std)
        self._outliers: list[np.ndarray] = []
        self._pairs: collections.deque[tuple[np.ndarray, np.ndarray]] = collections.deque(maxlen=_WINDOW)

    @property
    def _allowed(self) -> float:
        return self.options.authority * self._length

    def predict(
        self,
        stamp: float,
        tip_position: np.ndarray,
        tip_orientation: np.ndarray,
        response: "Response",
        tension: np.ndarray,
        touching: bool = False,
    ) -> None:
        """Remember a shape of the model: stamp in s, tip (3,) in m, orientation (4,) x y z w, tensions (m,) in N.

        touching: whether it leans on an obstacle.
        """
        if self.options.use:
            tip, turn = np.asarray(tip_position), np.asarray(tip_orientation)
            self._history.add(Prediction(stamp, tip, turn, response, np.asarray(tension), touching))

    def measure(self, stamp: float, arrival: float, frame: str, position: np.ndarray) -> bool:
        """Take a measurement; return whether it was accepted. `status` says why not.

        stamp of its header and arrival in s, of the clock of `predict`; frame: frame_id of its header; position (3,) in m.
        """
        if not self.options.use or not self._history:
            return False
        time = (stamp if self.options.stamp == "header" else arrival) - self.options.delay
        reason = self._unusable(stamp, time, arrival, frame, np.asarray(position, dtype=float))
        if not reason:
            measured = self._in_base(frame, np.asarray(position, dtype=float))
            reason = self._taken(time, measured)
        if reason:
            self._refused += 1
            self._in_a_row += 1
            self._refusal, self._last_refused = reason, arrival
            return False
        self._used, self._in_a_row, self._last_used = self._used + 1, 0, arrival
        return True

    def corrected(self, target: Target, now: float) -> Target:
        """Return the target that the model has to reach at `now` (s), so that the robot reaches `target`.

        Only the position of the tip is corrected; direction and points of the backbone are the model's.
        """
        if not self._used:
            return target
        wanted = self._filter.error(self._history.newest.sensitivity(self._rest_tip)) if self._before is not None else np.zeros(3)
        size = float(np.linalg.norm(wanted))
        if size > self._allowed:
            wanted = wanted * (self._allowed / size)
        # Steps of the estimate reach the motors no faster than the robot follows.
        share = lag_share(self._applied_at, now, self.options.response)
        step = share * (wanted - self._applied)
        self._applied, self._applied_at = self._applied + step, now
        if not self._history.newest.touching:
            self._followed = self._followed + step
        return target.with_tip_at(target.tip_position - self._applied)

    def status(self, now: float) -> TrackerStatus:
        """Return the state of the tracker at `now` (s)."""
        state, sentence = TrackerState.NONE, ""
        silent = now - self._last_refused
        if self._in_a_row >= _REFUSED and silent > self.options.stale_after:
            state = TrackerState.STALE
            sentence = f"no measured/tip has come for {silent:.1f} s; the last ones were refused: {self._refusal}"
        elif self._in_a_row >= _REFUSED:
            state, sentence = TrackerState.REFUSED, f"measured/tip is refused: {self._refusal}"
        elif self._used and now - self._last_used > self.options.stale_after:
            state = TrackerState.STALE
            sentence = f"no measured/tip was accepted for {now - self._last_used:.1f} s: the last correction is kept"
        elif self._used:
            state, sentence = TrackerState.USED, self._motion.sentence
        return TrackerStatus(state, sentence, self._applied, self._used, self._refused, self._restarts)

    # One measurement.

    def _unusable(self, stamp: float, time: float, arrival: float, frame: str, position: np.ndarray) -> str:
        """Return why a measurement cannot be compared with the model, empty where it can."""
        if not np.isfinite(position).all():
            return f"its position is ({', '.join(f'{v:g}' for v in position)}); finite numbers are needed"
        if frame not in self._frames:
            return f"it is in the frame '{frame}'; {' or '.join(repr(f) for f in self._frames)} is needed (tracker.frame)"
        wrong = wrong_stamp(stamp, arrival, self.options.longest_delay) if self.options.stamp == "header" else ""
        if wrong:
            return wrong
        if time <= self._last_stamp:
            return f"its stamp is {self._last_stamp - time:.3f} s before that of the last one"
        if time < self._history.oldest.stamp:
            return "it is older than the model's first shape"
        self._last_stamp = time
        self._equal = self._equal + 1 if (position == self._last_position).all() else 0
        self._last_position = position
        if self._equal >= _FROZEN:
            return f"its position has not changed in {self._equal + 1} measurements: the tracker repeats its last pose"
        return ""

    @property
    def _frames(self) -> tuple[str, ...]:
        return (self._base_frame, self.options.frame) if self.options.frame else (self._base_frame,)

    def _in_base(self, frame: str, position: np.ndarray) -> np.ndarray:
        if frame == self._base_frame:
            return position
        return self._turn.apply(position) + self.options.position

    def _taken(self, time: float, measured: np.ndarray) -> str:
        """Compare a measured point (3,) in m with the model at `time`, and take it; return why not, empty where it is taken."""
        then = self._history.at(time)
        turn = Rotation.from_quat(then.tip_orientation)
        modelled = then.tip_position + turn.apply(self.options.marker)
        residual = measured - modelled
        far = bool(np.linalg.norm(residual) > self._allowed)
        self._pairs.append((measured, modelled))
        axes = wrong_axes(self._pairs, self.options.std) if len(self._pairs) >= _LEAST else ""
        if axes:
            pairs = self._pairs
            self._restart()
            self._pairs = pairs  # until the motion agrees again
            self._motion.forget()
            return axes
        if far:
            return wild(measured, modelled, self._length, self._allowed)
        sensitivity = then.sensitivity(self._rest_tip)
        # While the model moves, the robot is somewhere on the way behind it.
        behind = then.tip_position - self._history.at(time - self.options.response).tip_position
        noise = self.options.std**2 * np.eye(3) + np.outer(behind, behind)
        # Without what the correction moves: it moves the model, and the robot stays at its target.
        motion = self._motion.observe(time, measured, modelled + self._followed, then.touching)
        if motion is Disagreement.HELD:
            if self._agreed is not None:
                self._filter = self._agreed.copy()
            return self._motion.sentence
        self._diffuse(then)
        if self._filter.distance(residual, sensitivity, noise) > GATE:
            return self._outlier(then, residual, sensitivity, noise)
        self._outliers.clear()
        self._filter.update(residual, sensitivity, noise)
        if self._motion.agrees:
            self._agreed = self._filter.copy()
        return ""

    def _diffuse(self, then: Prediction) -> None:
        """Let the estimate become uncertain with the time and the change of load since the last measurement."""
        gravity = then.gravity_part(self._rest_tip)
        change = self._by_gravity.moved(gravity) + self._by_cables.moved(then.cable_part())
        self._largest_sag = max(self._largest_sag, float(np.linalg.norm(gravity)))
        if self._before is not None:
            elapsed = then.stamp - self._before.stamp
            self._filter.diffuse(
                (self.options.drift * self._largest_sag) ** 2 * elapsed + _HYSTERESIS**2 * change * self._largest_sag,
                self.options.model_error**2 * elapsed / self.options.forget,
            )
        self._before = then

    def _outlier(self, then: Prediction, residual: np.ndarray, sensitivity: np.ndarray, noise: np.ndarray) -> str:
        """Count an outlier; return why it is one, or, after several that agree, begin again from them and return nothing."""
        missed = 1e3 * float(np.linalg.norm(residual - self._filter.error(sensitivity)))
        self._outliers.append(residual)
        recent = np.array(self._outliers[-_SHIFTED:])
        spread = np.linalg.norm(recent - np.median(recent, axis=0), axis=1)
        if len(recent) < _SHIFTED or spread.max() ** 2 > GATE * float(np.trace(noise)) / 3.0:
            return f"an outlier, {missed:.1f} mm from the estimate (tracker.std_mm is {1e3 * self.options.std:g})"
        self._restarts += self._used > 0
        self._restart()
        self._before = then
        for entry in recent:
            self._filter.update(entry, sensitivity, noise)
        return ""
