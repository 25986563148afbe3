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
from collections.abc import Callable

import numpy as np

from gravcomp.description import Robot
from gravcomp.first_order_lag import lag_share
from gravcomp.full_model.shape import Shape
from gravcomp.full_model.wrench import Wrench
from gravcomp.load_estimation.anchored_follower import AnchoredFollower, Answer, Worker
from gravcomp.load_estimation.estimate import LoadEstimate
from gravcomp.load_estimation.load_filter import LoadFilter
from gravcomp.load_estimation.needed_force import NeededForce
from gravcomp.load_estimation.options import LoadEstimationOptions
from gravcomp.load_estimation.predictions import Prediction, Predictions
from gravcomp.load_estimation.sensitivity import HeldRobot
from gravcomp.load_estimation.tension_check import LEAST, TensionCheck
from gravcomp.mesh.robot_axis import rest_tip
from gravcomp.standard_gravity import STANDARD_GRAVITY

# Squared Mahalanobis distance of an outlier: 1 in 10000 good measurements is farther (chi-square, 3 and about 6 numbers).
_GATE_TIP, _GATE_TENSIONS = 21.1, 27.9
_TOPICS = {"tip": "measured/tip", "tensions": "measured/tension"}
# Outliers in a row: then it is the load that has changed. A tracker has fewer samples, and its spikes are single ones.
_OUTLIERS = {"tip": 3, "tensions": 6}
_RESTS = 0.5  # of the time of `zero`: at most so long the robot comes to rest before anything is learnt
_REACH = 1.5  # lengths of the robot from its base: a tip that is measured beyond is none, however far the body stretches


class LoadObserver:
    """Estimates the load of one robot."""

    def __init__(self, robot: Robot, options: LoadEstimationOptions, worker: Worker | None = None):
        """worker: of the model that predicts for a force while the tip is measured; None: shapes are given to `predict` only."""
        self._robot, self.options = robot, options
        self._follower = None if worker is None else AnchoredFollower(worker, robot.length, options.stale_after)
        self._rest_tip = rest_tip(robot)[0]
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._predictions = Predictions()
        self._filter: LoadFilter | None = None
        largest = self._robot.limits.tension_max
        self._check = TensionCheck(self._robot.cable_names, largest, self.options.tension_offset * largest)
        self._before: collections.deque[LoadFilter] = collections.deque(maxlen=LEAST)  # before each reading of tensions
        self._scale = 0.0  # of the load: N, or kg of a payload
        self._learns_from, self._zero_until, self.zeroed, self._released = -np.inf, -np.inf, False, False
        self._last_change: tuple[float, np.ndarray] | None = None
        self._needed = NeededForce(self.options)
        self._rests_at = np.inf  # s, when a robot whose load has changed is at rest
        self._applied, self._applied_at = np.zeros(self._numbers), -np.inf
        self._seen: dict[str, float] = {}
        self._outliers: dict[str, int] = {}
        self._faults: dict[str, str] = {}  # of what was measured last, by its topic
        self._last_wrench: Wrench | None = None
        self._far = False  # from the running model when the tip was measured last
        if self._follower is not None:
            self._follower.reset()

    @property
    def _numbers(self) -> int:
        return 1 if self.options.kind == "payload" else 3

    def follow(self, stamp: float, shape: Shape, wound: np.ndarray | None, known: tuple[Wrench, ...] = ()) -> bool:
        """Predict with the model whose tip is held where it was measured, if `shape` of the running model is far from there.

        False: that shape predicts, if it is an equilibrium. wound (m,) in m as in `predict`; known wrenches act in addition.
        """
        if self._follower is None or not self._follower.takes_over(stamp, shape):
            return False
        if self._filter is None or wound is None:
            return False
        for answer in self._follower.step(shape.gravity, wound, known):
            self._predict_anchored(answer)
        return True

    def predict(
        self, stamp: float, shape: Shape, tip_compliance: np.ndarray, carried: np.ndarray, wound: np.ndarray | None
    ) -> None:
        """Remember a shape of the model: stamp in s, compliance (3, 3) m/N of the tip, and the force (3,) N that it carries.

        wound (m,) m: displacements that its winches hold, None: released.
        """
        robot = HeldRobot(shape, tip_compliance, wound, self._rest_tip)
        if self._filter is None:
            sag = float(np.linalg.norm(shape.response.effector_free[:3] - self._rest_tip))
            self._filter = LoadFilter(self.options, self._robot.limits, len(shape.cable_tension), self._numbers, sag)
        if not self._scale and (shape.cable_tension > 0.0).any():
            strongest = float(np.linalg.norm(robot.under(np.zeros(3)).tension_force, 2))
            self._scale = self._robot.limits.tension_max / strongest
            if self.options.kind == "payload":
                self._scale /= STANDARD_GRAVITY
        if self._is_anchored:  # what was published last is kept until more is measured
            self._filter.set_load(*self._needed_load)
            self._before.clear()
            self._needed.reset()
        self._remember(Prediction(stamp, shape.tip_position, shape.cable_tension, robot, carried, shape.gravity, None))

    def _predict_anchored(self, answer: Answer) -> None:
        """Remember a shape whose tip is held where it was measured, unless a newer one is remembered."""
        newest, found, asked = self._predictions.newest, answer.found, answer.question
        assert self._filter is not None and found is not None
        if newest is not None and newest.stamp >= asked.stamp:
            return
        shape = found.shape
        robot = HeldRobot(shape, found.tip_compliance, asked.wound, self._rest_tip, found.by_loads)
        covariance = self._filter.covariance_by_tip(robot, found.carried, answer.off, self._scale)
        self._remember(
            Prediction(asked.stamp, shape.tip_position, shape.cable_tension, robot, found.carried, shape.gravity, covariance)
        )
        self._needed.add(asked.stamp, found.carried, self._predictions.needed(), robot.under(np.zeros(3)).tip_force)

    def _remember(self, prediction: Prediction) -> None:
        """Add a prediction, and release the load when it is known at what scale, and no zero is being learnt."""
        assert self._filter is not None
        if self._predictions.add(prediction):  # a replay has restarted
            self._seen.clear()
        if self._scale and not self._released and prediction.stamp >= self._zero_until:
            self._filter.open_load(self._scale)
            self._filter.learning, self._released = False, True
            self._before.clear()

    def zero(self, now: float) -> None:
        """Begin to learn the model's errors and the sensors' zeros: the robot carries no load for `zero_time` s.

        The model lets go at once of what it has carried, and the cables move. Friction turns round then, and the robot is behind
        the model; both would be taken for errors that last. So what is measured in the first `friction_time` is not learnt.
        """
        self._zero_until = now + self.options.zero_time
        self._learns_from = now + min(self.options.friction_time, _RESTS * self.options.zero_time)
        self._before.clear()
        if self._filter is not None:
            self._filter.set_load(np.zeros(self._numbers), np.zeros((self._numbers, self._numbers)))
            self._filter.learning = True
        self._released, self.zeroed, self._rests_at = False, True, np.inf
        self._applied[:] = 0.0

    def measure_tip(self, stamp: float, position: np.ndarray) -> None:
        """Take a measured tip (3,) m in soft_base at its stamp (s). One that cannot be right is named, and not used."""
        self._faults["measured/tip"] = self._objection(position)
        if self._faults["measured/tip"]:
            return
        if self._follower is not None:
            self._follower.anchor(stamp, position)
            if self._follower.measured_at == stamp:
                self._needed.tip_measured(stamp)
        then = self._predictions.at(stamp)
        if then is None or self._filter is None:
            return
        if self._follower is not None:
            far = self._follower.near if then.anchored else self._follower.far
            away = bool(np.linalg.norm(position - then.tip) > far)
            self._far = away or then.anchored
            if away:  # the anchored model comes to it first
                return
        self._diffuse(then, then.tension)
        moved, _ = self._predictions.moved(then, self.options.lag)
        direction = self._direction(then.gravity)
        self._take(
            "tip", then, lambda one: one.take_tip(position - then.tip, then.robot, direction, then.carried, moved), _GATE_TIP
        )

    def _objection(self, position: np.ndarray) -> str:
        """Return what is wrong with a measured tip (3,) m, empty for nothing."""
        if not np.isfinite(position).all():
            return "it is not finite"
        distance, length = float(np.linalg.norm(position)), self._robot.length
        if distance > _REACH * length:
            return (
                f"it is {1e3 * distance:.4g} mm from soft_base, and the robot is {1e3 * length:.4g} mm long: its unit or frame?"
            )
        return ""

    def measure_tensions(self, stamp: float, tension: np.ndarray) -> None:
        """Take measured tensions (m,) N at their stamp (s). Sensors that cannot be right are named, and not used."""
        then = self._predictions.at(stamp)
        if then is None or self._filter is None:
            return
        fault = self._check.observe(tension, then.tension, self.zeroed and not self._released)
        self._faults["measured/tension"] = fault
        if fault and self._before:  # what it has said before it was found is forgotten
            self._filter = self._before[0]
            self._before.clear()
            self._outliers.pop("tensions", None)
        if fault or not self._check.is_known:
            return
        self._before.append(self._filter.copy())
        self._diffuse(then, np.abs(tension))
        _, moved = self._predictions.moved(then, self.options.lag)
        residual, direction = tension - then.tension, self._direction(then.gravity)
        self._take(
            "tensions",
            then,
            lambda one: one.take_tensions(residual, then.robot, direction, then.carried, moved, tension),
            _GATE_TENSIONS,
        )

    def wrench(self, gravity: np.ndarray, now: float) -> Wrench | None:
        """Return the load that the model has to carry from `now` (s) on under gravity (3,) m/s^2; None: none."""
        options = self.options
        compensates = options.compensate if options.kind == "payload" else options.compensate_force
        if self._filter is None or not compensates or not self._released:
            return None
        wanted = self._filter.load if self._seen else np.zeros(self._numbers)
        if self._far:  # the running model would lose its equilibrium under what has pushed the robot so far
            wanted = np.zeros(self._numbers)
        largest = 2.0 * self._scale
        size = float(np.linalg.norm(wanted))
        wanted = wanted * min(1.0, largest / size) if size > 0.0 else wanted
        share = lag_share(self._applied_at, now, options.response)
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
        sentence = self._said(now, sources)
        if self._filter is None:
            return LoadEstimate(np.zeros(3), np.full((3, 3), np.inf), 0.0, np.inf, False, sources, sentence)
        load, covariance = self._filter.load, self._filter.load_covariance + self._filter.unexplained
        payload, force, spread = self.options.kind == "payload", direction @ load, direction @ covariance @ direction.T
        if self._is_anchored:
            force, spread = self._needed_load
        return LoadEstimate(
            force=force,
            covariance=spread,
            mass=float(load[0]) if payload else np.nan,
            mass_std=float(np.sqrt(covariance[0, 0])) if payload else np.nan,
            zeroed=self.zeroed,
            sources=sources,
            sentence=sentence,
        )

    def close(self) -> None:
        """End what computes the anchored model."""
        if self._follower is not None:
            self._follower.close()

    def _said(self, now: float, sources: tuple[str, ...]) -> str:
        """Return what the user has to know at `now` (s), empty while all is well. sources: what was measured lately."""
        faulty = [f"{topic} is not used: {fault}" for topic, fault in self._faults.items() if fault]
        if self._follower is not None and self._follower.sentence:
            faulty.append(self._follower.sentence)
        if sources or faulty:
            missing = [
                f"{_TOPICS[name]} has not been used for {now - at:.1f} s"
                for name, at in self._seen.items()
                if name not in sources and not self._faults.get(_TOPICS[name])
            ]
            return "; ".join(faulty + missing)
        newest = self._predictions.newest
        if not self._seen:
            return "neither tips nor tensions are measured: the load is not known"
        if self._far and self._follower is not None and now - self._follower.measured_at <= self.options.stale_after:
            return "the model has not come to the measured tip, which is far from it: the last estimate is kept"
        if newest is None or now - newest.stamp > self.options.stale_after:
            return (
                "the model finds no equilibrium under the load, which may be more than the cables hold: the last estimate is kept"
            )
        return "no measurement lately: the last estimate is kept"

    def _take(self, source: str, then: Prediction, step: Callable[[LoadFilter], float], gate: float) -> None:
        """Let the filter take a measurement; an outlier is left out, and several in a row mean that the load has changed.

        A robot whose load has changed moves. What is measured meanwhile is a first estimate, which that at rest replaces.
        """
        assert self._filter is not None
        if self._filter.learning and then.stamp < self._learns_from:
            self._seen[source] = then.stamp
            return
        if then.stamp >= self._rests_at:
            self._filter.open_load(self._scale)
            self._rests_at = np.inf
        taken = self._filter.copy()
        if step(taken) > gate:
            self._outliers[source] = self._outliers.get(source, 0) + 1
            if self._outliers[source] < _OUTLIERS[source]:
                return
            taken = self._filter.copy()
            if self._released:
                taken.open_load(self._scale)
                self._rests_at = then.stamp + self.options.friction_time
            step(taken)
        self._filter, self._outliers[source] = taken, 0
        self._seen[source] = then.stamp

    def _direction(self, gravity: np.ndarray) -> np.ndarray:
        return gravity[:, None] if self.options.kind == "payload" else np.eye(3)

    @property
    def _needed_load(self) -> tuple[np.ndarray, np.ndarray]:
        """The force (3,) N that the measured tip needs, its covariance (3, 3). The newest prediction is of the anchored model.

        Far bent, friction and stretch of the cables are not those that were learnt.
        """
        newest = self._predictions.newest
        assert newest is not None and newest.covariance is not None
        return self._needed.mean, newest.covariance

    @property
    def _is_anchored(self) -> bool:
        """Whether the load is what the anchored model carries."""
        newest = self._predictions.newest
        return self._released and newest is not None and newest.anchored

    def _diffuse(self, then: Prediction, pull: np.ndarray) -> None:
        """Let the filter forget with the time and the change of tensions since the newest measurement. pull (m,): tensions, N."""
        assert self._filter is not None
        if self._last_change is not None:
            before, tension = self._last_change
            if then.stamp > before:  # a tip arrives later than tensions that were measured after it
                self._filter.diffuse(then.stamp - before, self._scale if self._released else 0.0, pull, then.tension - tension)
            if then.anchored and self._released:  # nothing else is known than what the anchored model needs to be where it is
                self._filter.set_load(then.carried, self._scale**2 * np.eye(self._numbers))
        if self._last_change is None or then.stamp > self._last_change[0]:
            self._last_change = then.stamp, then.tension
