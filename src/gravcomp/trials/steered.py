"""A person steers the robot through a lumen to a target on its wall, with and without compensation of gravity.

The tip begins in the inlet, the robot straight. The target counts as reached when it has been near the middle of the picture, and
within the working distance of a tool, for a moment, and when no part of the robot has entered a wall.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.operator.followed_path import FollowedPath
from gravcomp.operator.handle import PushedHandle
from gravcomp.operator.person import Person, Steering
from gravcomp.operator.picture import Camera
from gravcomp.scene import SceneSection, TubeWall
from gravcomp.scene.scene import Scene
from gravcomp.trials.lumen import Lumen
from gravcomp.virtual.motion import base_orientation

REST = 1.5  # s before the person begins
DEPTH = 0.02e-3  # m, beyond which the robot has entered a wall
_PERIOD = 0.04  # s between pictures
_HALF_VIEW = np.radians(70.0)  # of the camera, as of colonoscopes
_NEAR, _CENTRED, _MOMENT = 2.0, np.radians(15.0), 0.5  # robot's widths from the tip, off the middle, s
_RAISED = 0.25  # of the robot's width, by which the middle of the target stands out of the wall, as a polyp does
_BEND = 2.0  # of the robot's length is the tightest circle's circumference that the lever commands
_INTO = 0.3  # of the robot's length: the tube goes on behind the target
_SPACING = 0.1  # of the robot's length: points that describe the tube


@dataclass(frozen=True)
class Passage:
    """A way to steer.

    The lumen in a frame at inclination and roll (deg), the target at the arc length `depth` m and `angle` rad
    around the wall, from the plane of bending; first: arc length of the tip at the start, m; seconds: until it is given up.
    """

    name: str
    lumen: Lumen
    inclination: float
    roll: float
    first: float
    depth: float
    angle: float
    seconds: float
    friction: float = 0.1  # wet mucosa

    @property
    def orientation(self) -> np.ndarray:
        """Rotation (3, 3): world from the lumen's frame."""
        return base_orientation(np.radians(self.inclination), np.radians(self.roll))

    def target(self, raised: float = 0.0) -> np.ndarray:
        """Place (3,) of the target in the lumen's frame, `raised` m above the wall."""
        along = self.lumen.direction(np.array(self.depth))
        plane = np.array([-np.sin(self.lumen.plane), np.cos(self.lumen.plane), 0.0])
        inward = np.cross(plane, along)
        across = np.cos(self.angle) * inward + np.sin(self.angle) * plane
        return self.lumen.point(np.array(self.depth)) + (0.5 * self.lumen.diameter - raised) * across

    def scene(self, length: float) -> Scene:
        """Return the lumen as a rigid tube in the world, for a robot of `length` m."""
        way = np.arange(0.0, self.depth + _INTO * length, _SPACING * length)
        points = tuple(map(tuple, (self.lumen.point(way) @ self.orientation.T).tolist()))
        wall = TubeWall(name=self.name, frame="world", friction=self.friction, points=points, radius=(self.lumen.diameter / 2,))
        return Scene(SceneSection(tubes=(wall,)), self.name)


@dataclass(frozen=True)
class Steered:
    """What came of it; t samples, of which every fifth gives b backbone points; in SI units and the lumen's frame.

    reached; time (s) until then or until it was given up; path (m): way of the tip; worst (m): depth in a wall; hurt: share of
    the time at pain.
    """

    passage: Passage
    compensated: bool
    seed: int
    reached: bool
    time: float
    path: float
    worst: float
    hurt: float
    samples: np.ndarray  # (t,) s
    tip: np.ndarray  # (t / 5, 3)
    body: np.ndarray  # (t / 5, b, 3)
    force: np.ndarray  # (t,) N, of the wall

    @property
    def peak(self) -> float:
        """Largest force of the wall, N: the mean over a tenth of a second, as a sensor would show it."""
        window = np.ones(10) / 10
        return float(np.convolve(self.force, window, mode="valid").max()) if len(self.force) >= 10 else float(self.force.max())

    @property
    def mean(self) -> float:
        """Mean force of the wall, N."""
        return float(self.force.mean())


def steer(job: tuple[Setup, Passage, bool, int]) -> Steered:
    """Let a person steer once: setup, passage, with compensation or not, seed of hand and virtual robot."""
    setup, passage, compensated, seed = job
    robot, person = setup.robot, Person()
    length, width = robot.length, robot.segments[-1].outer_diameter
    scene = passage.scene(length)
    handle = PushedHandle(passage.orientation, passage.first - length, seed)
    loop = ClosedLoop(dataclasses.replace(setup, scene=scene, seed=seed), handle)
    path = FollowedPath(length, robot.segments[-1].full_length, 2.0 * np.pi / (_BEND * length), setup.direction_weight)
    line = passage.lumen.point(np.linspace(0.0, passage.depth + 0.2 * length, 80)) @ passage.orientation.T
    camera = Camera(scene.turned(np.eye(3)), line, _HALF_VIEW)  # pictures are taken in the world
    hand = Steering(person, _PERIOD, np.pi * (width / 2) ** 2, seed)
    target = passage.orientation @ passage.target(_RAISED * width)
    loop.hold(path.target(passage.first), weightless=not compensated)
    loop.run(REST)
    start, held, reached, hurt = loop.time, 0.0, False, 0
    while loop.time < start + passage.seconds - 1e-9:
        truth = loop.truth
        base = Rotation.from_quat(truth.base_orientation).as_matrix()
        tip = truth.base_position + base @ truth.tip_position
        picture = camera.look(tip, base @ Rotation.from_quat(truth.tip_orientation).as_matrix(), target)
        does = hand.act(picture, truth.wall_force)
        hurt += does.hurt
        near = float(np.linalg.norm(target - tip)) < _NEAR * width
        held = held + _PERIOD if near and picture.off_middle < _CENTRED else 0.0
        if held >= _MOMENT:
            reached = True
            break
        handle.wanted = does.speed
        path.bend(does.rate * _PERIOD)
        loop.hold(path.target(handle.along + length), weightless=not compensated)
        loop.run(_PERIOD)
    trace = loop.trace.between(start)
    turn = Rotation.from_quat(trace.base_orientation).as_matrix()
    body = (np.einsum("tij,tbj->tbi", turn, trace.backbone) + trace.base_position[:, None]) @ passage.orientation
    worst = float(trace.depth.max())
    tips = body[:, -1]
    return Steered(
        passage=passage,
        compensated=compensated,
        seed=seed,
        reached=reached and worst <= DEPTH,
        time=float(trace.time[-1] - start),
        path=float(np.linalg.norm(np.diff(tips, axis=0), axis=1).sum()),
        worst=worst,
        hurt=hurt * _PERIOD / max(loop.time - start, _PERIOD),
        samples=trace.time - start,
        tip=tips[::5],
        body=body[::5],
        force=trace.wall_force,
    )
