"""A robot that touches itself: changes of the gap, equilibria of a coiled robot, the virtual robot's rod, what is refused."""

import dataclasses

import numpy as np
import pytest

from gravcomp.bench.contact_itself import COILED_FROM, GRAVITY, coiled_file, coiled_rod, wind
from gravcomp.bench.sampled_depth import sampled_own_depth
from gravcomp.config import ConfigError
from gravcomp.contact.own_pairs import may_touch, part_that_passes
from gravcomp.contact.own_places import FIXED, MOVED, RIM, ROUND, find_own
from gravcomp.contact.own_rows import own_rows, own_turning
from gravcomp.contact.own_surface import OwnSurface
from gravcomp.description import Elements, Section, Segment, load_robot_file
from gravcomp.scene import PlaneWall, SceneSection
from gravcomp.scene.scene import Scene
from gravcomp.simulation import Simulator

ITSELF = Scene(SceneSection(self_contact=True))
RADIUS, LENGTH, STATIONS = 2e-3, 0.2, 60
NOTHING = np.zeros((0, 2)), np.zeros(0)
G = np.array([-9.81, 0.0, 0.0])
DEPTH = 0.02e-3  # m, as for rigid walls


def along(line, count=STATIONS):
    """Surface and sections of a robot whose axis is `line` (k, 3), of even spacing; its tip is at station `count`."""
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


def smooth_motion(rng, surface, sections, turned_from):
    """A smooth motion (n, 3, 3) of all sections but that of the base; those from a station on turn."""
    share = surface.place / surface.place[-1]
    middle = sum(np.sin(1.3 * (k + 1) * share)[:, None] * rng.standard_normal(3) for k in range(4)) * 0.05 * LENGTH
    turn = share[:, None] * rng.standard_normal(3) * (np.arange(len(share)) >= turned_from)[:, None]
    moved = np.stack([middle, np.cross(turn, sections[:, 1]), np.cross(turn, sections[:, 2])], axis=1)
    moved[0] = 0.0
    return moved


@pytest.mark.parametrize(
    ("kind", "robot"),
    [
        (FIXED, helix(2.3, 4.05e-3)),  # turns side by side
        (MOVED, loop(1.0, 4.05e-3)),  # it crosses itself
        (ROUND, loop(0.6, 0.0, 52)),  # the rim of the tip comes to the stem
        (RIM, loop(1.5, 0.0, 52)),  # the face of the tip
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
        # A section that turns in a straight line grows, to second order, and with it the radius of a ball.
        moved = smooth_motion(rng, surface, sections, stations if kind in (ROUND, RIM) else stations + 1)
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


FILE = coiled_file()
COILED = dataclasses.replace(FILE, robot=dataclasses.replace(FILE.robot, elements=Elements(around=4, along=24)))
WINDING = [*range(1, 14), 13.5, 14.0, 15.0, 16.0]  # mm of cable c1


@pytest.fixture(scope="module")
def coiled():
    """Simulator of the example's robot, with the shapes and what touches at the last steps of winding up, and back by one."""
    simulator, found = Simulator(COILED.robot, reduced=False, scene=COILED.scene), {}
    for step, wound in enumerate([*WINDING, WINDING[-2]]):
        shape = simulator.step(GRAVITY, np.array([1e-3 * wound, np.nan, np.nan]))
        found[step] = shape, simulator.solver.state
    return simulator, [found[step] for step in sorted(found)[-4:]]


def test_a_robot_that_coils_beyond_a_full_turn_does_not_pass_through_itself(coiled):
    simulator, found = coiled
    contact = simulator.solver.contact
    for shape, state in found:
        sections = contact.sections(state.u)
        axis = np.cross(sections[:, 1], sections[:, 2])
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        assert shape.is_equilibrium
        assert np.degrees(np.arccos((axis[1:] * axis[:-1]).sum(axis=1)).sum()) > 330.0
        assert shape.contacts.normal_force.min() > 1e-4
        assert (shape.contacts.against < 0.4).all() and (shape.contacts.station > 0.9).all()
        assert set(shape.contacts.names) == {"self"} == set(shape.contacts.by_obstacle().names)
        assert abs(shape.contacts.gap).max() < 1e-7
        assert sampled_own_depth(simulator.model, state.u, contact.own.surface) < DEPTH


def test_the_forces_on_both_parts_are_equal_and_opposite(coiled):
    simulator, found = coiled
    model = simulator.model
    for shape, state in found:
        pull = state.touch.pull.reshape(-1, 3)
        moment = np.cross((model.mesh.nodes + state.u)[: model.n_free], pull).sum(axis=0)
        size = shape.contacts.normal_force.sum()
        assert np.abs(pull).sum() > size
        np.testing.assert_allclose(pull.sum(axis=0), 0.0, atol=1e-9 * size)
        # Forces along the line between both places: no moment but that of the change of the radii.
        np.testing.assert_allclose(moment, 0.0, atol=1e-2 * size * RADIUS)


def test_a_closed_path_leads_back(coiled):
    (_, _), (first, _), _, (last, _) = coiled[1]
    np.testing.assert_allclose(last.tip_position, first.tip_position, atol=1e-5 * COILED.robot.length)
    np.testing.assert_allclose(last.cable_tension, first.cable_tension, rtol=1e-4)


def test_the_rod_touches_itself_as_the_model_does(coiled):
    (shape, _) = coiled[1][0]
    rod = coiled_rod(COILED)
    assert wind(rod, COILED_FROM, 1e-3 * WINDING[-3])
    pushed = np.linalg.norm(rod.touches.force, axis=1)
    assert (rod.touches.row == -1).all() and rod.touches.depth.max() < 1e-6
    assert np.abs(rod.velocity[:, :3]).max() < 1e-4  # it rests
    assert pushed.sum() == pytest.approx(shape.contacts.normal_force.sum(), rel=0.1)
    # Without contact the tip would stay in the plane of the coil, within 0.3 mm.
    assert rod.position[-1][1] == pytest.approx(shape.tip_position[1], abs=2e-3 * COILED.robot.length)


def test_a_robot_that_does_not_touch_itself_is_the_same_with_the_option():
    robot = dataclasses.replace(load_robot_file("article").robot, elements=Elements(around=6, along=8))
    tips = []
    for scene in (None, ITSELF):
        simulator = Simulator(robot, reduced=False, scene=scene)
        tips.append([simulator.step(G, cables).tip_position for cables in (None, np.full(len(robot.cables), 1e-3))])
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-12)


def test_the_reduced_model_is_left_before_the_robot_touches_itself():
    surface, sections = helix(2.3, 4.1e-3)
    assert may_touch(surface, sections, 2e-4)
    assert not may_touch(*helix(2.3, 4.0 * RADIUS), 2e-4) and not may_touch(*helix(0.8, 0.0), 2e-4)


def test_own_contact_is_refused_where_it_cannot_be_computed():
    robot = load_robot_file("article").robot
    flat = Segment("flat", robot.length, section=Section("rectangle", 9e-3, 8e-3), material=robot.segments[0].material)
    with pytest.raises(ConfigError, match=r"scene: scene.self_contact: .* round sections only; that 0 mm from the base is not"):
        Simulator(
            dataclasses.replace(robot, segments=(flat,), cables=(), elements=Elements(around=8, along=4)),
            reduced=False,
            scene=ITSELF,
        )
    with pytest.raises(ValueError, match="a body from a file has no outlines"):
        Simulator(load_robot_file("mesh_body").robot, reduced=False, scene=ITSELF)
    with pytest.raises(ValueError, match="'self' is that of the robot with self_contact"):
        SceneSection(planes=(PlaneWall(name="self"),), self_contact=True)
