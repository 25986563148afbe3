"""The observer: compares tips and tensions with the model that carries the load estimated so far, and improves the estimate.

    observer.follow(stamp, shape, wound, known)              # the model whose tip is held where it was measured; without it
    observer.predict(stamp, shape, tip_compliance, carried, wound)   # each shape of the model, and the force that it carries
    observer.zero(now)                                        # the robot carries nothing now: what differs is the model's error
    observer.measure_tip(stamp, position), observer.measure_tensions(stamp, tensions)
    observer.wrench(gravity, now)                             # for the next step of the model
    observer.estimate(gravity, now)

The model that carries the estimate is nearly that of the robot: the residuals are linear in what the estimate lacks, also where
the load bends the robot far. Where the running model's tip is far from the measured one, an `AnchoredModel` takes over for a
force: it has an equilibrium whatever the force is. G. Zhang, Z. Chen, L. Wang (arXiv 2501.05418) find the shape from the tip's
pose first and then the force from the tensions by virtual work; here both enter with their variances, gravity and the model's
errors are part of it, and either sensor alone is enough.
"""

import collections
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gravcomp.description import Robot
from gravcomp.first_order_lag import lag_share
from gravcomp.full_model.shape import Shape
from gravcomp.full_model.wrench import Wrench
from gravcomp.load_estimation.anchored_model import AnchoredModel
from gravcomp.load_estimation.estimate import LoadEstimate
from gravcomp.load_estimation.load_filter import LoadFilter
from gravcomp.load_estimation.options import LoadEstimationOptions
from gravcomp.load_estimation.sensitivity import HeldRobot
from gravcomp.load_estimation.tension_check import TensionCheck
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.standard_gravity import STANDARD_GRAVITY

_KEPT = 2.0  # s of predictions, for measurements that arrive late
_APART = 0.1  # s, farthest of a measurement from the predictions: without an equilibrium the model has no new ones
# Squared Mahalanobis distance of an outlier: 1 in 10000 good measurements is farther (chi-square, 3 and about 6 numbers).
_GATE_TIP, _GATE_TENSIONS = 21.1, 27.9
_OUTLIERS = 6  # in a row: then it is the load that has changed
_REACH = 1.2  # lengths of the robot from its base: a tip that is measured beyond is none
_CONSTANT = 1e5  # s: a payload changes at once or not at all


class _Prediction(NamedTuple):
    stamp: float
    tip: np.ndarray
    tension: np.ndarray
    robot: HeldRobot
    carried: np.ndarray
    gravity: np.ndarray
    anchored: bool
    covariance: np.ndarray | None  # (3, 3) of the force that an anchored model carries


class LoadObserver:
    """Estimates the load of one robot."""

    def __init__(
        self,
        robot: Robot,
        options: LoadEstimationOptions,
        anchored: AnchoredModel | None = None,
        share: float | None = None,
    ):
        """anchored: predicts for a force while the tip is measured; None: shapes are given to `predict` only.

        share: of the time between the stamps that the anchored model may take, by the clock; None: any, for results that do not
        depend on the machine.
        """
        self._robot, self.options, self._share = robot, options, share
        self._anchored = anchored if options.kind == "force" else None
        self._rest_tip = rest_tip(robot)[0]
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._history: collections.deque[_Prediction] = collections.deque()
        self._filter: LoadFilter | None = None
        self._check = TensionCheck(self._robot.cable_names, self._robot.limits.tension_max)
        self._scale = 0.0  # of the load: N, or kg of a payload
        self._zero_until, self.zeroed, self._released = -np.inf, False, False
        self._last_change: tuple[float, np.ndarray] | None = None
        self._applied, self._applied_at = np.zeros(self._numbers), -np.inf
        self._seen: dict[str, float] = {}
        self._outliers: dict[str, int] = {}
        self._sentence = ""
        self._last_wrench: Wrench | None = None
        self._anchored_at, self._followed_at, self._newest, self._rest_until = -np.inf, -np.inf, -np.inf, -np.inf
        self._far = False  # from the running model when the tip was measured last
        if self._anchored is not None:
            self._anchored.reset()

    @property
    def _numbers(self) -> int:
        return 1 if self.options.kind == "payload" else 3

    def follow(self, stamp: float, shape: Shape, wound: np.ndarray | None, known: tuple[Wrench, ...] = ()) -> bool:
        """Predict with the model whose tip is held where it was measured, if `shape` of the running model is far from there.

        False: that shape predicts, if it is an equilibrium. wound (m,) in m as in `predict`; known wrenches act in addition.
        """
        if self._anchored is None:
            return False
        if stamp < self._newest:  # a replay has restarted
            self._anchored_at, self._followed_at, self._rest_until = -np.inf, -np.inf, -np.inf
        self._newest = stamp
        if self._filter is None or wound is None or stamp - self._anchored_at > self.options.stale_after:
            return False
        if shape.is_equilibrium and not self._anchored.is_off(shape.tip_position):
            return False
        if stamp < self._rest_until:
            return True
        elapsed, started = stamp - self._followed_at, time.perf_counter()
        found = self._anchored.step(shape.gravity, wound, known, elapsed if 0.0 < elapsed <= _KEPT else None)
        self._followed_at = stamp
        if found is not None:  # else it is on its way to the tip
            self.predict(stamp, found.shape, found.tip_compliance, found.carried, wound, found.by_loads)
        if self._share is not None:
            self._rest_until = stamp + (time.perf_counter() - started) / self._share
        return True

    def predict(
        self,
        stamp: float,
        shape: Shape,
        tip_compliance: np.ndarray,
        carried: np.ndarray,
        wound: np.ndarray | None,
        by_loads: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Remember a shape of the model: stamp in s, compliance (3, 3) m/N of the tip, and the force (3,) N that it carries.

        wound (m,) m: displacements that its winches hold, None: released; by_loads: of a shape whose tip is held where it was
        measured, see `HeldRobot`.
        """
        robot = HeldRobot(shape, tip_compliance, wound, self._rest_tip, by_loads)
        tip, tension = shape.tip_position, shape.cable_tension
        if self._filter is None:
            sag = float(np.linalg.norm(shape.response.effector_free[:3] - self._rest_tip))
            self._filter = LoadFilter(self.options, self._robot.limits, len(shape.cable_tension), self._numbers, sag)
        if not self._scale and (tension > 0.0).any():
            strongest = float(np.linalg.norm(robot.under(np.zeros(3)).tension_force, 2))
            self._scale = self._robot.limits.tension_max / strongest
            if self.options.kind == "payload":
                self._scale /= STANDARD_GRAVITY
        covariance = None
        if by_loads is not None and self._anchored is not None:
            off = self._anchored.distance_to(tip)
            covariance = self._filter.covariance_by_tip(robot, carried, off, self._scale)
        elif self._is_anchored:  # what was published last is kept until more is measured
            self._filter.set_load(*self._needed())
        if self._history and stamp < self._history[-1].stamp:  # a replay has restarted
            self._history.clear()
            self._seen.clear()
        self._history.append(_Prediction(stamp, tip, tension, robot, carried, shape.gravity, by_loads is not None, covariance))
        while self._history[0].stamp < stamp - _KEPT:
            self._history.popleft()
        if self._scale and not self._released and stamp >= self._zero_until:
            self._filter.set_load(np.zeros(self._numbers), self._scale**2 * np.eye(self._numbers))
            self._filter.learning, self._released = False, True

    def zero(self, now: float) -> None:
        """Begin to learn the model's errors and the sensors' zeros: the robot carries no load for `zero_time` s."""
        self._zero_until = now + self.options.zero_time
        if self._filter is not None:
            self._filter.set_load(np.zeros(self._numbers), np.zeros((self._numbers, self._numbers)))
            self._filter.learning = True
        self._released, self.zeroed = False, True
        self._applied[:] = 0.0

    def measure_tip(self, stamp: float, position: np.ndarray) -> None:
        """Take a measured tip (3,) m in soft_base at its stamp (s)."""
        if not np.isfinite(position).all():
            return
        anchored = self._anchored if np.linalg.norm(position) < _REACH * self._robot.length else None
        # A model that is on its way to the tip predicts nothing, and has to know where the tip is now.
        if anchored is not None and self._anchored_at <= stamp and abs(self._newest - stamp) <= self.options.stale_after:
            anchored.anchor(position)
            self._anchored_at = stamp
        then = self._at(stamp)
        if then is None or self._filter is None:
            return
        if anchored is not None:
            away = bool(np.linalg.norm(position - then.tip) > (anchored.near if then.anchored else anchored.far))
            self._far = away or then.anchored
            if away:  # the anchored model comes to it first
                return
        self._diffuse(then)
        moved, _ = self._moved(then)
        direction = self._direction(then.gravity)
        self._take(
            "tip", then, lambda one: one.take_tip(position - then.tip, then.robot, direction, then.carried, moved), _GATE_TIP
        )

    def measure_tensions(self, stamp: float, tension: np.ndarray) -> None:
        """Take measured tensions (m,) N at their stamp (s). Sensors that cannot be right are named, and not used."""
        then = self._at(stamp)
        if then is None or self._filter is None:
            return
        self._sentence = self._check.observe(tension, then.tension)
        if self._sentence:
            return
        self._diffuse(then)
        _, moved = self._moved(then)
        residual, direction = tension - then.tension, self._direction(then.gravity)
        self._take(
            "tensions",
            then,
            lambda one: one.take_tensions(residual, then.robot, direction, then.carried, moved, tension),
            _GATE_TENSIONS,
        )

    def wrench(self, gravity: np.ndarray, now: float) -> Wrench | None:
        """Return the load that the model has to carry from `now` (s) on under gravity (3,) m/s^2; None: none."""
        if self._filter is None or not self.options.compensate or not self._released:
            return None
        wanted = self._filter.load if self._seen else np.zeros(self._numbers)
        if self._far:  # the running model would lose its equilibrium under what has pushed the robot so far
            wanted = np.zeros(self._numbers)
        largest = 2.0 * self._scale
        size = float(np.linalg.norm(wanted))
        wanted = wanted * min(1.0, largest / size) if size > 0.0 else wanted
        share = lag_share(self._applied_at, now, self.options.response)
        self._applied = self._applied + share * (wanted - self._applied)
        self._applied_at = now
        self._last_wrench = Wrench(self._direction(gravity) @ self._applied)
        return self._last_wrench

    def carries(self, wrenches: tuple[Wrench, ...]) -> np.ndarray:
        """Return the force (3,) in N of the last one of a model's wrenches if it is that of `wrench`, else zeros."""
        return wrenches[-1].force if wrenches and self._last_wrench is wrenches[-1] else np.zeros(3)

    def without(self, wrenches: tuple[Wrench, ...]) -> tuple[Wrench, ...]:
        """Return a model's wrenches without that of `wrench`."""
        return tuple(one for one in wrenches if one is not self._last_wrench)

    def estimate(self, gravity: np.ndarray, now: float) -> LoadEstimate:
        """Return the estimate under gravity (3,) m/s^2 at `now` (s)."""
        direction = self._direction(gravity)
        sources = tuple(name for name, at in self._seen.items() if now - at <= self.options.stale_after)
        sentence = self._sentence
        if not sources and not sentence:
            if not self._seen:
                sentence = "neither tips nor tensions are measured: the load is not known"
            elif self._far and now - self._anchored_at <= self.options.stale_after:
                sentence = "the model has not come to the measured tip, which is far from it: the last estimate is kept"
            elif now - self._history[-1].stamp > self.options.stale_after:
                sentence = (
                    "the model finds no equilibrium under the load, which may be more than the cables hold:"
                    " the last estimate is kept"
                )
            else:
                sentence = "no measurement lately: the last estimate is kept"
        if self._filter is None:
            return LoadEstimate(np.zeros(3), np.full((3, 3), np.inf), 0.0, np.inf, False, sources, sentence)
        load, covariance = self._filter.load, self._filter.load_covariance
        payload, force, spread = self.options.kind == "payload", direction @ load, direction @ covariance @ direction.T
        if self._is_anchored:
            force, spread = self._needed()
        return LoadEstimate(
            force=force,
            covariance=spread,
            mass=float(load[0]) if payload else np.nan,
            mass_std=float(np.sqrt(covariance[0, 0])) if payload else np.nan,
            zeroed=self.zeroed,
            sources=sources,
            sentence=sentence,
        )

    def _take(self, source: str, then: _Prediction, step: Callable[[LoadFilter], float], gate: float) -> None:
        """Let the filter take a measurement; an outlier is left out, and several in a row mean that the load has changed."""
        assert self._filter is not None
        taken = self._filter.copy()
        if step(taken) > gate:
            self._outliers[source] = self._outliers.get(source, 0) + 1
            if self._outliers[source] < _OUTLIERS:
                return
            taken = self._filter.copy()
            if self._released:
                taken.open_load(self._scale)
            step(taken)
        self._filter, self._outliers[source] = taken, 0
        self._seen[source] = then.stamp

    def _direction(self, gravity: np.ndarray) -> np.ndarray:
        return gravity[:, None] if self.options.kind == "payload" else np.eye(3)

    def _at(self, stamp: float) -> _Prediction | None:
        """Return the prediction nearest to a stamp; None for a stamp before the first one or far ahead."""
        if not self._history or not np.isfinite(stamp):
            return None
        if not self._history[0].stamp - _APART <= stamp <= self._history[-1].stamp + _APART:
            return None
        return min(self._history, key=lambda entry: abs(entry.stamp - stamp))

    @property
    def _is_anchored(self) -> bool:
        """Whether the load is what the anchored model carries."""
        return self._released and bool(self._history) and self._history[-1].anchored

    def _needed(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the force (3,) N that the anchored model has carried lately, on average, and its covariance (3, 3).

        Far bent, friction and stretch of the cables are not those that were learnt: the force is what the measured tip needs.
        """
        covariance = self._history[-1].covariance
        assert covariance is not None
        force: np.ndarray = np.mean([entry.carried for entry in self._history if entry.anchored], axis=0)
        return force, covariance

    def _behind(self, then: _Prediction) -> _Prediction:
        """Return the prediction at which the robot may still be."""
        return self._at(max(then.stamp - self.options.lag, self._history[0].stamp)) or then

    def _moved(self, then: _Prediction) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much the robot may be behind the model: tip (3,) m and tensions (m,) N."""
        behind = self._behind(then)
        if then.anchored:
            return then.robot.by_winding(behind.robot)
        return then.tip - behind.tip, then.tension - behind.tension

    def _diffuse(self, then: _Prediction) -> None:
        """Let the filter forget with the time and the change of tensions since the last measurement."""
        assert self._filter is not None
        if self._last_change is not None:
            before, tension = self._last_change
            time = _CONSTANT if self.options.kind == "payload" else self.options.change_time
            # Nothing is known of a load but that the cables hold it, or what the anchored model needs to be where it is.
            around = then.carried if then.anchored and self._released else np.zeros(self._numbers)
            self._filter.diffuse(
                max(0.0, then.stamp - before), around, self._scale if self._released else 0.0, time, then.tension - tension
            )
        self._last_change = then.stamp, then.tension
