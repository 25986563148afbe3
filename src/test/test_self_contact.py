"""A robot that touches itself: the gap and its changes, equilibria of a coiled robot, the virtual robot's rod, what is refused."""

import dataclasses

import numpy as np
import pytest

from gravcomp.bench.sampled_depth import sampled_own_depth
from gravcomp.config import ConfigError
from gravcomp.contact.own_places import FIXED, MOVED, RIM, ROUND, find_own, part_that_passes
from gravcomp.contact.own_rows import own_rows, own_turning
from gravcomp.contact.own_surface import OwnSurface
from gravcomp.description import load_robot_file
from gravcomp.scene import PlaneWall, SceneSection
from gravcomp.scene.scene import Scene
from gravcomp.simulation import Simulator

ITSELF = Scene(SceneSection(self_contact=True))
RADIUS, LENGTH, STATIONS = 2e-3, 0.2, 60
NOTHING = np.zeros((0, 2)), np.zeros(0)
G = np.array([-9.81, 0.0, 0.0])
DEPTH = 0.02e-3  # m, as for rigid walls


def along(line, count=STATIONS):
    """Surface and sections of a robot whose axis is `line` (k, 3), of even spacing; its tip is at the last of `count` stations."""
    fine = np.linspace(0.0, LENGTH, len(line))
    place = LENGTH / STATIONS * np.arange(count + 1)
    middle = np.column_stack([np.interp(place, fine, line[:, j]) for j in range(3)])
    axis = np.gradient(line, axis=0)
    axis = np.column_stack([np.interp(place, fine, axis[:, j]) for j in range(3)])
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    two = np.array([0.0, 1.0, 0.0]) - axis[:, 1:2] * axis
    two /= np.linalg.norm(two, axis=1)[:, None]
    angle = 2.0 * np.pi * np.arange(8) / 8
    surface = OwnSurface(place, np.full(count + 1, RADIUS), RADIUS * np.column_stack([np.cos(angle), np.sin(angle)]))
    return surface, np.stack([middle, np.cross(two, axis), two], axis=1)


def loop(angle, pitch, count=STATIONS):
    """A stem, then a ring that comes back to it by `angle` (rad) before it is closed, `pitch` m aside."""
    place = np.linspace(0.0, LENGTH, 6001)
    turned = np.clip((place - 0.06) / 0.02, 0.0, 2.0 * np.pi - angle)
    step = place[1]
    aside = pitch * np.clip((place - 0.06) / (0.04 * np.pi), 0.0, 1.0)
    return along(np.column_stack([np.cumsum(np.sin(turned)) * step, aside, np.cumsum(np.cos(turned)) * step]), count)


def helix(turns, pitch):
    angle = 2.0 * np.pi * turns * np.linspace(0.0, 1.0, 6001)
    wide = LENGTH / (2.0 * np.pi * turns)
    return along(np.column_stack([wide * (1.0 - np.cos(angle)), pitch * angle / (2.0 * np.pi), wide * np.sin(angle)]))


def places_near(surface, sections, margin):
    return find_own(surface, sections, np.zeros((len(sections), 3)), margin, *NOTHING)


def smooth_motion(rng, surface, sections):
    """A smooth motion (n, 3, 3) of all sections but that of the base."""
    share = surface.place / surface.place[-1]
    middle = sum(np.sin(1.3 * (k + 1) * share)[:, None] * rng.standard_normal(3) for k in range(4)) * 0.05 * LENGTH
    turn = share[:, None] * rng.standard_normal(3)
    moved = np.stack([middle, np.cross(turn, sections[:, 1]), np.cross(turn, sections[:, 2])], axis=1)
    moved[0] = 0.0
    return moved


@pytest.mark.parametrize(
    "kind, robot",
    [
        (FIXED, helix(2.3, 4.05e-3)),  # turns side by side
        (MOVED, loop(1.0, 4.05e-3)),  # it crosses itself
        (ROUND, loop(0.6, 0.0, 52)),  # the rim of the tip comes to the stem
        (RIM, loop(1.5, 0.0, 51)),  # the face of the tip
    ],
)
def test_the_gap_changes_by_its_rows_and_by_the_forces_that_turn(kind, robot):
    surface, sections = robot
    found, rng, stations, step = places_near(surface, sections, 1e-3), np.random.default_rng(0), len(sections) - 1, 1e-5
    i = int(np.flatnonzero(found.kind == kind)[0])
    pressed = np.zeros(len(found.kind))
    pressed[i] = 1.0
    turning, bend = own_turning(found, pressed, stations, surface.place[-1])
    for _ in range(3):
        moved = smooth_motion(rng, surface, sections)
        gaps = []
        for side in (-step, 0.0, step):
            other = places_near(surface, sections + side * moved, 1e-3)
            same = (other.kind == kind) & (other.slot == found.slot[i]) & (np.abs(other.place[:, 1] - found.place[i, 1]) < 1.0)
            gaps.append(float(other.gap[same][0]))
        first, second = (gaps[2] - gaps[0]) / (2.0 * step), (gaps[2] - 2.0 * gaps[1] + gaps[0]) / step**2
        flat = moved[1:].ravel()
        assert own_rows(found, stations)[i] @ flat == pytest.approx(first, rel=1e-5, abs=1e-6)
        # The curve through the stations has a bend that jumps at them, which the second change takes as smooth.
        assert bend @ (turning @ flat) ** 2 == pytest.approx(second, rel=2e-2, abs=1e-3)


def test_a_robot_that_is_bent_as_sharply_as_it_can_does_not_touch_its_neighbours():
    wide = 1.05 * RADIUS
    angle = np.clip((np.linspace(0.0, LENGTH, 6001) - 0.5 * LENGTH) / wide, 0.0, 0.5 * np.pi)
    step = LENGTH / 6000
    surface, sections = along(np.column_stack([np.cumsum(np.sin(angle)) * step, 0.0 * angle, np.cumsum(np.cos(angle)) * step]))
    assert len(places_near(surface, sections, 1e-5).kind) == 0


def test_no_part_passes_another_in_a_step():
    surface, sections = loop(1.0, 6e-3)
    through = np.zeros((len(sections), 3))
    through[50:, 1] = -12e-3  # the far part, to the other side of the stem
    part = part_that_passes(surface, sections, through)
    assert 0.1 < part < 0.6
    assert part_that_passes(surface, sections, 1e-3 * through) == 1.0


@pytest.fixture(scope="module")
def coiled():
    """The example's robot with fewer elements, wound up until it touches itself: simulator, shapes from there on, work, energy."""
    file = load_robot_file("src/examples/coiled_robot.yaml")
    robot = dataclasses.replace(file.robot, elements=dataclasses.replace(file.robot.elements, around=4, along=14))
    simulator, shapes = Simulator(robot, reduced=False, scene=file.scene), []
    for wound in COILED_PATH:
        shapes.append(simulator.step(COILED_GRAVITY, np.array([1e-3 * wound, np.nan, np.nan])))
    return simulator, shapes
