"""A person who steers: the picture, the hand, and the path that the body follows."""

import numpy as np
import pytest

from gravcomp.operator.followed_path import FollowedPath
from gravcomp.operator.handle import PushedHandle
from gravcomp.operator.person import Person, Steering
from gravcomp.operator.picture import Camera, Picture
from gravcomp.scene import SceneSection, SphereWall, TubeWall
from gravcomp.scene.scene import Scene

PERIOD = 0.04
LINE = np.stack([np.zeros(50), np.zeros(50), np.linspace(0.0, 0.2, 50)], axis=1)


def camera(*balls) -> Camera:
    tube = TubeWall(points=((0.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, 0.2)), radius=(0.015,))
    return Camera(Scene(SceneSection(tubes=(tube,), spheres=balls)).arrays, LINE, np.radians(70.0))


def test_a_place_in_the_picture_is_its_direction_from_the_tip():
    target = np.array([0.005, -0.003, 0.05])
    picture = camera().look(np.zeros(3), np.eye(3), target)
    assert picture.target is not None
    angle = np.arctan2(np.hypot(0.005, 0.003), 0.05)
    np.testing.assert_allclose(picture.target, angle * np.array([0.005, -0.003]) / np.hypot(0.005, 0.003), rtol=1e-9)
    assert picture.ahead is not None
    np.testing.assert_allclose(picture.ahead, 0.0, atol=1e-9)


def test_what_a_wall_hides_or_the_camera_does_not_face_is_not_seen():
    target = np.array([0.0, 0.0, 0.08])
    ball = SphereWall(centre=(0.0, 0.0, 0.04), radius=0.003)
    assert camera(ball).look(np.zeros(3), np.eye(3), target).target is None
    assert camera().look(np.zeros(3), np.diag([1.0, -1.0, -1.0]), target).target is None


def closed_loop(person: Person, seconds: float, seed: int = 1, force: float = 0.0):
    """Aim at a place that is 0.3 rad off at first; the angles over time, and what the hand did last."""
    steering = Steering(person, PERIOD, 6.4e-5, seed)
    error, course = np.array([0.3, 0.0]), []
    for _ in range(round(seconds / PERIOD)):
        hand = steering.act(Picture(error, None), force)
        error = error - PERIOD * hand.rate
        course.append(error)
    return np.array(course), hand


def test_a_camera_that_faces_back_sees_nothing():
    backward = np.diag([1.0, -1.0, -1.0])
    picture = camera().look(np.array([0.0, 0.0, -0.05]), backward, np.array([0.0, 5e-3, 0.05]))
    assert picture.target is None and picture.ahead is None and picture.off_middle == np.inf


def test_the_hand_waits_for_its_delay_and_then_aims_at_the_crossover_frequency():
    course, _ = closed_loop(Person(), 8.0)
    late = round(0.25 / PERIOD)
    np.testing.assert_allclose(course[: late - 1], np.tile([0.3, 0.0], (late - 1, 1)))
    # The remnant has no mean: over the seeds the error is that of an integrator with a delay.
    expected = [0.3] * (late + 1)
    for _ in range(200 - late):
        expected.append(expected[-1] - PERIOD * Person().crossover * expected[-1 - late])
    mean = np.mean([closed_loop(Person(), 8.0, seed)[0][:, 0] for seed in range(60)], axis=0)
    np.testing.assert_allclose(mean, expected[1 : 1 + len(mean)], atol=0.03)


def test_a_delay_too_long_for_the_crossover_frequency_is_unstable():
    # The integrator with a delay is stable for w_c tau < pi / 2.
    course, _ = closed_loop(Person(delay=0.6, crossover=3.5), 20.0)
    assert np.abs(course[-50:]).max() > 0.3


def test_pain_makes_the_hand_pull_back_until_it_has_gone():
    person = Person()
    steering = Steering(person, PERIOD, 6.4e-5, 1)
    aimed = Picture(np.zeros(2), None)
    for _ in range(10):
        hand = steering.act(aimed, 0.0)
    assert hand.speed == pytest.approx(person.speed)
    for _ in range(10):
        hand = steering.act(aimed, 1.2 * steering.pain_force)
    assert hand.hurt
    assert hand.speed == pytest.approx(-person.pull_speed)
    for _ in range(10):
        hand = steering.act(aimed, 0.8 * steering.pain_force)
    assert hand.hurt, "the pain has not gone"
    for _ in range(10):
        hand = steering.act(aimed, 0.4 * steering.pain_force)
    assert not hand.hurt


def test_the_body_follows_the_path_of_the_tip():
    path = FollowedPath(0.1, 0.05, 60.0, 1e-3)
    np.testing.assert_allclose(path.target(0.0).tip_position, [0.0, 0.0, 0.1], atol=1e-12)
    path.bend(np.array([0.5, 0.0]))
    bent = path.target(0.0)
    np.testing.assert_allclose(bent.tip_direction, [np.sin(0.5), 0.0, np.cos(0.5)], atol=0.01)
    path.bend(np.array([-0.5, 0.0]))
    later = path.target(0.05)
    # What the lever commanded at the beginning is now in the proximal half, the tip goes straight on.
    np.testing.assert_allclose(later.tip_direction, [np.sin(0.5), 0.0, np.cos(0.5)], atol=0.03)
    assert later.backbone_position[1][0] > 0.01


def test_the_handle_moves_along_its_axis_as_the_hand_wants():
    handle = PushedHandle(np.eye(3), -0.06, 3)
    handle.wanted = 0.01
    for k in range(500):
        handle.pose(0.002 * (k + 1))
    assert handle.along == pytest.approx(-0.06 + 0.01 * (1.0 - PushedHandle.lag), abs=2e-4)
