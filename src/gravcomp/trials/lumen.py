"""Reaching through a lumen: its centreline, the motion of a base that is pushed along it, and how far the robot stays from the wall.

The lumen lies fixed in the world. Its centreline runs straight for `inlet` along z of its frame, then along an arc of `radius` in the plane at
`plane` (about z from x). The base is pushed along the inlet's axis; with the tip at the arc length d along the centreline the robot shall
lie on the centreline from d - L to d, and behind the inlet's mouth on the straight line before it.

Bent cables shorten the robot. Who pushes the base can make up for it, as far as the model knows: `Feed` is that push beyond the way asked for.

There is no contact, neither in the model nor in the virtual robot: a negative clearance says by how much the robot would press into the wall.
"""

from dataclasses import dataclass

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop, Trace
from gravcomp.closed_loop.setup import Setup
from gravcomp.evaluation import metrics
from gravcomp.inverse import Target
from gravcomp.virtual.motion import BaseMotion, StaticMotion, SyntheticMotion, TremorMotion, base_orientation

REST = 4.0  # s before the base is pushed
_TARGET_STEPS = 0.1  # s between two targets
_FEED_GAIN = 0.3  # of what the model is short by, made up for until the next target
# The tip leads; the body has weights, too, so that it follows the centreline.
_STATIONS, _WEIGHTS = (0.25, 0.5, 0.75), (0.3, 0.3, 0.3)


@dataclass(frozen=True)
class Lumen:
    """SI: inlet and radius (0: straight) in m, plane in rad, diameter in m."""

    inlet: float
    radius: float
    plane: float
    diameter: float

    def point(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) points of the centreline at arc lengths s (k,)."""
        s = np.asarray(s, float)
        beyond = np.maximum(s - self.inlet, 0.0)
        if not self.radius:
            across, along = np.zeros_like(s), s
        else:
            turn = beyond / self.radius
            across, along = self.radius * (1 - np.cos(turn)), np.minimum(s, self.inlet) + self.radius * np.sin(turn)
        return np.stack([across * np.cos(self.plane), across * np.sin(self.plane), along], axis=-1)

    def direction(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) unit tangents."""
        turn = np.maximum(np.asarray(s, float) - self.inlet, 0.0) / (self.radius or np.inf)
        return np.stack([np.sin(turn) * np.cos(self.plane), np.sin(turn) * np.sin(self.plane), np.cos(turn)], axis=-1)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(...,) m: distance of points (..., 3) from the centreline."""
        from scipy.spatial import cKDTree

        fine = np.arange(-0.15, 0.35, 0.2e-3)
        return cKDTree(self.point(fine)).query(points)[0]


@dataclass(frozen=True)
class Reach:
    """One run. lumen; inclination and roll of the inlet in deg; first and last: arc length of the tip in m; duration s; hand: it trembles."""

    name: str
    lumen: Lumen
    inclination: float
    roll: float
    first: float
    last: float
    duration: float
    hand: bool

    @property
    def orientation(self) -> np.ndarray:
        """(3, 3): world from the lumen's frame."""
        return base_orientation(np.radians(self.inclination), np.radians(self.roll))

    def depth(self, time: np.ndarray) -> np.ndarray:
        """Arc length of the tip asked for at a time."""
        return self.first + (self.last - self.first) * _smooth(np.clip((np.asarray(time) - REST) / self.duration, 0.0, 1.0))

    def motion(self, length: float, seed: int, feed: "Feed") -> BaseMotion:
        """How the base moves, in world axes with the lumen's mouth as origin."""
        still = StaticMotion(self.orientation)
        return _PushedMotion(self, length, TremorMotion(self.orientation, seed) if self.hand else still, feed)


class Feed:
    """How far the base is pushed beyond the way asked for, over time; in m."""

    def __init__(self) -> None:
        self._time, self._value = [0.0], [0.0]

    def at(self, time: float) -> float:
        """Linear between the moments given, and as the last one says after it."""
        return float(np.interp(time, self._time, self._value))

    def add(self, time: float, short: float) -> None:
        """Until `time`, push on by a part of what the model is `short` by."""
        self._time.append(time)
        self._value.append(self._value[-1] + _FEED_GAIN * short)


class _PushedMotion(SyntheticMotion):
    """A base that is pushed along the inlet while a hand moves it besides."""

    def __init__(self, reach: Reach, length: float, hand: BaseMotion, feed: Feed):
        self._reach, self._length, self._hand, self._feed = reach, length, hand, feed

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        orientation, shift = self._hand.pose(time)
        along = float(self._reach.depth(time)) - self._length + self._feed.at(time)
        return orientation, shift + self._reach.orientation[:, 2] * along


@dataclass(frozen=True)
class Reached:
    """What came of a run, all in the lumen's frame; t samples. `clearance` and `deviation` in m, `camera` in rad, tip_error in soft_base."""

    reach: Reach
    time: np.ndarray  # (t,)
    depth: np.ndarray  # (t,)
    tip: np.ndarray  # (t, 3)
    body: np.ndarray  # (t, b, 3)
    clearance: np.ndarray  # (t,) least distance from the wall inside the lumen
    deviation: np.ndarray  # (t,) tip from the centreline
    camera: np.ndarray  # (t,) tip's direction against the centreline's
    tip_error: np.ndarray  # (t,) tip from what was asked for in soft_base
    lateral: np.ndarray  # (t,) its part across the direction asked for


WITHOUT, HELD, FED = "without", "with", "with, base fed"
"""Ways to reach: without compensation; with; with, and the base pushed on by what the model is short by."""


def run_reach(job: tuple[Setup, Reach, str]) -> Reached:
    """Reach through in one of the three ways."""
    setup, reach, way = job
    feed = Feed()
    motion = reach.motion(setup.robot.length, setup.seed, feed)
    loop = ClosedLoop(setup, motion)
    while loop.time < REST + reach.duration - 1e-9:
        target = target_at(setup, reach, float(reach.depth(loop.time)), feed.at(loop.time))
        if way == FED:
            feed.add(loop.time + _TARGET_STEPS, float((target.tip_position - loop.shape.tip_position) @ target.tip_direction))
        loop.hold(target, weightless=way == WITHOUT)
        loop.run(_TARGET_STEPS)
    return _judged(setup, reach, loop.trace.between(REST), motion, feed)


def target_at(setup: Setup, reach: Reach, depth: float, feed: float = 0.0) -> Target:
    """The shape on the centreline with the tip at the arc length `depth`, in soft_base of a base that is held as it should be and fed by
    `feed` (m).
    """
    length, lumen = setup.robot.length, reach.lumen
    base = depth - length + feed
    points = lumen.point(base + np.array([*_STATIONS, 1.0]) * (length - feed)) - np.array([0.0, 0.0, base])
    return Target(
        tip_position=points[-1],
        tip_direction=lumen.direction(np.array(depth)),
        tip_direction_weight=setup.controller.tip_direction_weight,
        backbone_station=np.array(_STATIONS),
        backbone_position=points[:-1],
        backbone_weight=np.array(_WEIGHTS),
    )


def _judged(setup: Setup, reach: Reach, trace: Trace, motion: BaseMotion, feed: Feed) -> Reached:
    lumen, robot = reach.lumen, setup.robot
    rows = slice(0, len(trace.time), 5)
    time, depth = trace.time[rows], reach.depth(trace.time[rows])
    poses = [motion.pose(t) for t in time]
    turn = np.array([reach.orientation.T @ orientation for orientation, _ in poses])
    origin = np.array([reach.orientation.T @ position for _, position in poses])
    body = np.einsum("tij,tbj->tbi", turn, trace.backbone[rows]) + origin[:, None]
    tip = body[:, -1]
    camera = np.einsum("tij,tj->ti", turn, trace.tip_direction[rows])
    room = 0.5 * (lumen.diameter - robot.segments[0].outer_diameter) - lumen.distance(body)
    # Only what has entered the mouth can touch the wall.
    clearance = np.where(body[:, :, 2] >= 0.0, room, np.inf).min(axis=1)
    targets = [target_at(setup, reach, float(d), feed.at(float(t))) for d, t in zip(depth, time)]
    wanted, along = (np.array(column) for column in zip(*((t.tip_position, t.tip_direction) for t in targets)))
    errors = metrics.tip_errors(trace.tip_position[rows], trace.tip_direction[rows], wanted, along)
    return Reached(
        reach=reach,
        time=time,
        depth=depth,
        tip=tip,
        body=body,
        clearance=clearance,
        deviation=lumen.distance(tip),
        camera=metrics.angle_between(camera, lumen.direction(depth)),
        tip_error=errors.distance,
        lateral=errors.lateral,
    )


def _smooth(s: np.ndarray) -> np.ndarray:
    return s**2 * (3 - 2 * s)
