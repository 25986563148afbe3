"""Reaching through a lumen: its centreline, the motion of the base along it, and the clearance between robot and wall.

The lumen is fixed in the world. Its centreline is straight for `inlet` along z of its frame, then an arc of `radius` in the
plane at `plane` (about z from x). The base is advanced along the axis of the inlet. With the tip at arc length d the target
shape is the part of the centreline from d - L to d; before the mouth of the inlet (d < 0) the centreline continues straight.

Cables that bend the robot also shorten it. The base can be advanced by this shortening as the model predicts it: `Feed`.

These runs have no wall: a negative clearance is the depth by which the robot would enter it. `steered` has the wall.
"""

from dataclasses import dataclass

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.evaluation import metrics
from gravcomp.inverse import Target
from gravcomp.virtual.motion import BaseMotion, StaticMotion, SyntheticMotion, TremorMotion, base_orientation

_TARGET_STEPS = 0.1  # s between two targets
_FEED_GAIN = 0.3  # share of the predicted shortening that is compensated until the next target
# Stations and weights of the body, in addition to the tip, so that the body follows the centreline.
_STATIONS, _WEIGHTS = (0.25, 0.5, 0.75), (0.3, 0.3, 0.3)


@dataclass(frozen=True)
class Lumen:
    """A lumen. inlet, radius (0: straight) and diameter in m, plane in rad."""

    inlet: float
    radius: float
    plane: float
    diameter: float

    def point(self, s: np.ndarray) -> np.ndarray:
        """Return points (k, 3) of the centreline at arc lengths s (k,), m."""
        s = np.asarray(s, float)
        beyond = np.maximum(s - self.inlet, 0.0)
        if not self.radius:
            across, along = np.zeros_like(s), s
        else:
            turn = beyond / self.radius
            across, along = self.radius * (1 - np.cos(turn)), np.minimum(s, self.inlet) + self.radius * np.sin(turn)
        return np.stack([across * np.cos(self.plane), across * np.sin(self.plane), along], axis=-1)

    def direction(self, s: np.ndarray) -> np.ndarray:
        """Return unit tangents (k, 3) of the centreline at arc lengths s (k,)."""
        turn = np.maximum(np.asarray(s, float) - self.inlet, 0.0) / (self.radius or np.inf)
        return np.stack([np.sin(turn) * np.cos(self.plane), np.sin(turn) * np.sin(self.plane), np.cos(turn)], axis=-1)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance (...,) of points (..., 3) from the centreline, m."""
        from scipy.spatial import cKDTree

        fine = np.arange(-0.15, 0.35, 0.2e-3)
        return cKDTree(self.point(fine)).query(points)[0]


@dataclass(frozen=True)
class Reach:
    """One run. inclination, roll: of the inlet, deg; first, last: arc length of the tip, m; duration in s; hand: with tremor.

    rest: time in s before the base is advanced.
    """

    name: str
    lumen: Lumen
    inclination: float
    roll: float
    first: float
    last: float
    duration: float
    hand: bool
    rest: float = 4.0

    @property
    def orientation(self) -> np.ndarray:
        """Rotation (3, 3): world from the lumen's frame."""
        return base_orientation(np.radians(self.inclination), np.radians(self.roll))

    def depth(self, time: float | np.ndarray) -> np.ndarray:
        """Return the arc length of the target tip at a time in s, m."""
        return self.first + (self.last - self.first) * _smooth(np.clip((np.asarray(time) - self.rest) / self.duration, 0.0, 1.0))

    def motion(self, length: float, seed: int, feed: "Feed") -> BaseMotion:
        """Return the motion of the base, in world axes with the lumen's mouth as origin."""
        still = StaticMotion(self.orientation)
        return _AdvancedMotion(self, length, TremorMotion(self.orientation, seed) if self.hand else still, feed)


class Feed:
    """Additional advance of the base over time, m, which compensates the shortening of the robot."""

    def __init__(self) -> None:
        self._time, self._value = [0.0], [0.0]

    def at(self, time: float) -> float:
        """Return the feed at a time: linear between the given times, constant after the last."""
        return float(np.interp(time, self._time, self._value))

    def add(self, time: float, shortening: float) -> None:
        """Advance further until `time`, by a share of the shortening that the model predicts (m)."""
        self._time.append(time)
        self._value.append(self._value[-1] + _FEED_GAIN * shortening)


class _AdvancedMotion(SyntheticMotion):
    """A base that is advanced along the inlet, in addition to the motion of the hand."""

    def __init__(self, reach: Reach, length: float, hand: BaseMotion, feed: Feed):
        self._reach, self._length, self._hand, self._feed = reach, length, hand, feed

    def pose(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        orientation, shift = self._hand.pose(time)
        along = float(self._reach.depth(time)) - self._length + self._feed.at(time)
        return orientation, shift + self._reach.orientation[:, 2] * along


@dataclass(frozen=True)
class Reached:
    """Outcome of a run with t samples, in SI units and the lumen's frame; tip_error and lateral in soft_base."""

    reach: Reach
    time: np.ndarray  # (t,)
    depth: np.ndarray  # (t,)
    tip: np.ndarray  # (t, 3)
    body: np.ndarray  # (t, b, 3)
    clearance: np.ndarray  # (t,) smallest distance to the wall inside the lumen
    deviation: np.ndarray  # (t,) distance of the tip from the centreline
    camera: np.ndarray  # (t,) angle between tip direction and centreline
    tip_error: np.ndarray  # (t,) distance of the tip from its target
    lateral: np.ndarray  # (t,) part of the tip error across the target direction


WITHOUT, HELD, FED = "without", "with", "with, base fed"
"""Ways to reach: without compensation; with it; with it and the base advanced by the predicted shortening."""


def run_reach(job: tuple[Setup, Reach, str]) -> Reached:
    """Run one reach in one of the three ways."""
    setup, reach, way = job
    feed = Feed()
    motion = reach.motion(setup.robot.length, setup.seed, feed)
    loop = ClosedLoop(setup, motion)
    while loop.time < reach.rest + reach.duration - 1e-9:
        target = target_at(setup, reach, float(reach.depth(loop.time)), feed.at(loop.time))
        if way == FED:
            assert loop.shape is not None and target.tip_direction is not None
            shortening = float((target.tip_position - loop.shape.tip_position) @ target.tip_direction)
            feed.add(loop.time + _TARGET_STEPS, shortening)
        loop.hold(target, weightless=way == WITHOUT)
        loop.run(_TARGET_STEPS)
    return _evaluated(setup, reach, loop.trace.between(reach.rest), motion, feed)


def target_at(setup: Setup, reach: Reach, depth: float, feed: float = 0.0) -> Target:
    """Return the target shape: on the centreline, with the tip at arc length `depth` (m), in soft_base without tremor.

    feed: additional advance of the base, m.
    """
    length, lumen = setup.robot.length, reach.lumen
    base = depth - length + feed
    points = lumen.point(base + np.array([*_STATIONS, 1.0]) * (length - feed)) - np.array([0.0, 0.0, base])
    return Target(
        tip_position=points[-1],
        tip_direction=lumen.direction(np.array(depth)),
        tip_direction_weight=setup.direction_weight,
        backbone_station=np.array(_STATIONS),
        backbone_position=points[:-1],
        backbone_weight=np.array(_WEIGHTS),
    )


def _evaluated(setup: Setup, reach: Reach, trace: Trace, motion: BaseMotion, feed: Feed) -> Reached:
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
    # Only the part inside the lumen can touch the wall.
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
