"""Can a robot be held: against closed forms, against the closed loop of model and controller, and what `model info` prints."""

import dataclasses
import json
import os
import threading
import time

import numpy as np
import pytest
import yaml

from gravcomp.commands.__main__ import main
from gravcomp.description import (
    Cable,
    Elements,
    Limits,
    Lumen,
    Material,
    Payload,
    RestShape,
    Robot,
    Section,
    Segment,
    load_robot_file,
)
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.holdability import Binding, HoldOptions, background, holdability, path
from gravcomp.holdability.as_json import as_json
from gravcomp.holdability.background import HoldProcess
from gravcomp.holdability.directions import angles, sphere
from gravcomp.holdability.motor_tension import weak_motors
from gravcomp.holdability.play import play_of
from gravcomp.holdability.search import HoldSearch
from gravcomp.holdability.symmetry import symmetries, symmetries_of, turns
from gravcomp.holdability.text import lines, sentence
from gravcomp.inverse import InverseController, straight_target
from gravcomp.inverse.rest_target import rest_target
from gravcomp.simulation import Simulator

_GRAVITY = 9.80665
_MODULUS, _DENSITY, _DIAMETER, _LENGTH, _RADIUS = 1.5e6, 1100.0, 10e-3, 0.12, 3.5e-3
_AREA, _INERTIA = np.pi * _DIAMETER**2 / 4, np.pi * _DIAMETER**4 / 64
_SIDE = np.array([[-1.0, 0.0, 0.0]])  # cable c0 at 0 deg holds alone


def arm(tension_max=5.0, modulus=_MODULUS, radius=_RADIUS, law="svk", angles_deg=(0, 120, 240), **limits):
    """A solid rod with cables along its whole length, in a coarse mesh."""
    material = Material(youngs_modulus=modulus, poissons_ratio=0.4, density=_DENSITY, law=law)
    segment = Segment("s", length=_LENGTH, outer_diameter=_DIAMETER, material=material)
    cables = tuple(Cable(f"c{k}", angle=np.radians(a), radius=radius, segment="s") for k, a in enumerate(angles_deg))
    return Robot(
        "arm",
        segments=(segment,),
        cables=cables,
        elements=Elements(around=8, along=4),
        limits=Limits(tension_max=tension_max, **limits),
    )


@pytest.fixture(scope="module")
def search():
    return HoldSearch(RobotModel(arm()))


def test_the_tension_is_that_of_the_beam(search):
    """M L^2 / 2 E I = w L^4 / 8 E I with M = T r; the rod sags little, but its cable is shortened and its tip turns."""
    found = search.answer(_SIDE[0])
    wanted = _DENSITY * _AREA * _GRAVITY * _LENGTH**2 / 4 / _RADIUS
    assert found.held and found.binding == Binding.NOTHING
    linear, _ = search.linear.tension(_GRAVITY * _SIDE[0])
    assert linear.max() == pytest.approx(wanted, rel=0.01)
    assert found.tension == pytest.approx(wanted, rel=0.06)
    assert found.lateral < search.tolerance and found.demand == pytest.approx(found.tension / 5.0)


def test_a_robot_that_would_sag_by_many_lengths_has_a_linear_estimate():
    """Its cables may not be pulled in by as much as the linear response asks for."""
    soft = HoldSearch(RobotModel(arm(modulus=2e-4 * _MODULUS, displacement_max=0.1)))
    for direction in sphere(6)[1:-1]:
        tension, lateral = soft.linear.tension(_GRAVITY * direction)
        assert tension.max() <= soft.wide.tension_max and lateral > 10.0 * _LENGTH


def test_an_upright_rod_buckles_at_its_critical_length(search):
    """Greenhill: a clamped rod buckles under its own weight at w L^3 = 7.837 E I."""
    points = search.path.follow(np.array([0.0, 0.0, -_GRAVITY]), search.wide, np.zeros(3), most=10.0)
    critical = 7.837 * _MODULUS * _INERTIA / (_DENSITY * _AREA * _GRAVITY * _LENGTH**3)
    last = points[-1]
    # The eigenvalue goes to zero linearly in the load.
    assert last.share + last.eigenvalues.free / (1.0 - last.eigenvalues.free) * last.share == pytest.approx(critical, rel=0.03)
    assert points[0].eigenvalues.free == pytest.approx(1.0, rel=1e-6)


def test_a_tension_limit_binds_and_what_would_do_is_computed():
    free = holdability(arm(), directions=_SIDE, with_needed=False).directions[0]
    limit = 0.6 * free.tension
    found = holdability(arm(tension_max=limit), directions=_SIDE)
    (direction,) = found.directions
    assert not found.held and direction.binding == Binding.TENSION and direction.cable == "c0"
    assert direction.share == pytest.approx(0.6, abs=0.03)
    assert found.needed.tension == pytest.approx(free.tension, rel=0.01)
    # Between the tip of the released robot and that of the held one; the rest is about the share of gravity that is not held.
    assert 0.2 * found.released < direction.lateral < 0.6 * found.released
    assert found.needed.radius_factor == pytest.approx(1.0 / 0.6, rel=0.1) and not found.needed.radius_fits
    assert found.needed.widest_factor == pytest.approx(0.5 * _DIAMETER / _RADIUS, rel=0.01)


def test_a_radius_that_fits_is_confirmed():
    free = holdability(arm(radius=2e-3), directions=_SIDE, with_needed=False).directions[0]
    limited = arm(radius=2e-3, tension_max=0.8 * free.tension)
    needed = holdability(limited, directions=_SIDE).needed
    assert needed.radius_fits and 1.2 < needed.radius_factor < 1.35
    wider = tuple(dataclasses.replace(cable, radius=2e-3 * needed.radius_factor) for cable in limited.cables)
    assert holdability(dataclasses.replace(limited, cables=wider), directions=_SIDE, with_needed=False).held


def test_a_displacement_limit_binds():
    free = holdability(arm(), directions=_SIDE, with_needed=False).directions[0]
    found = holdability(arm(displacement_max=0.5 * free.displacement), directions=_SIDE)
    assert found.directions[0].binding == Binding.DISPLACEMENT and found.directions[0].share == pytest.approx(0.5, abs=0.1)
    assert found.needed.displacement == pytest.approx(free.displacement, rel=0.05)


def test_two_cables_cannot_hold_against_gravity_across_their_plane():
    found = holdability(arm(angles_deg=(0, 180)), directions=np.array([[0.0, 1.0, 0.0]]))
    assert found.directions[0].binding == Binding.CABLES and found.directions[0].share < 0.2
    assert found.needed is None


def test_a_robot_that_is_too_soft_buckles_upright_and_says_so():
    found = holdability(arm(modulus=0.15 * _MODULUS), directions=np.array([[0.0, 0.0, -1.0]]))
    critical = 7.837 * 0.15 * _MODULUS * _INERTIA / (_DENSITY * _AREA * _GRAVITY * _LENGTH**3)
    assert critical < 1.0 and found.directions[0].binding == Binding.BUCKLING
    assert found.buckling == pytest.approx(critical, abs=0.04) and found.directions[0].lateral is None


@pytest.mark.parametrize("share", [0.6, 1.5])
def test_the_answer_is_that_of_the_closed_loop_of_model_and_controller(share):
    """With a limit above what is needed the loop reaches the target, and below it ends at the error that was predicted."""
    limit = share * holdability(arm(), directions=_SIDE, with_needed=False).directions[0].tension
    robot = arm(tension_max=limit)
    found = holdability(robot, directions=_SIDE, with_needed=False).directions[0]
    simulator, gravity = Simulator(robot, reduced=False), _GRAVITY * _SIDE[0]
    controller, shape = InverseController(robot), simulator.solve(gravity)
    for _ in range(60):
        command = controller.step(
            shape.response, straight_target(_LENGTH), backbone_station=shape.backbone_station, tension=shape.cable_tension,
            interval=0.1,
        )  # fmt: skip
        shape = simulator.step(gravity, command.displacement)
    lateral = np.hypot(*shape.tip_position[:2])
    assert found.held == (lateral < 0.005 * _LENGTH)
    assert lateral == pytest.approx(found.lateral, abs=2e-3 * _LENGTH)
    if not found.held:
        assert shape.cable_tension.max() == pytest.approx(limit, rel=0.02)


def test_the_answer_does_not_depend_on_the_order(search):
    first, second = sphere(4)[2], sphere(4)[3]
    before = search.answer(first)
    search.answer(second)
    assert all(np.array_equal(a, b) for a, b in zip(dataclasses.astuple(search.answer(first)), dataclasses.astuple(before)))


def test_an_answer_holds_for_all_directions_that_turns_and_mirrors_of_the_robot_give(search, monkeypatch):
    found = symmetries(search.robot, search.target)
    assert len(found) == 6 and turns(found) == 3
    one, asked = search.answer(_SIDE[0]), []
    for symmetry in found[1:3]:  # the other two cables
        image, own = symmetry.of(one), search.answer(symmetry.of(one).direction)
        assert image.held == own.held and image.demand == pytest.approx(own.demand, rel=0.01)
    monkeypatch.setattr(HoldSearch, "answer", lambda self, direction: asked.append(direction) or dataclasses.replace(
        one, direction=direction, cable="c0"))  # fmt: skip
    answers = holdability(search.model, with_needed=False).directions
    assert len(answers) == 1 + len(sphere(12, 3)) == 45 and len(asked) <= 14
    for answer in answers:
        assert any(np.abs(symmetry.of(answer).direction - direction).max() < 1e-9 for symmetry in found for direction in asked)
    assert {answer.cable for answer in answers} == {"c0", "c1", "c2"}


@pytest.mark.parametrize(
    ("change", "number"),
    [
        ({"payload": Payload(5e-3, (0.0, 1e-3, 0.0))}, 1),
        ({"segments": (Segment("s", length=_LENGTH, outer_diameter=_DIAMETER, lumens=(Lumen(2e-3, x=2e-3),)),)}, 1),
        ({"segments": (Segment("s", length=_LENGTH, section=Section("rectangle", 10e-3, 10e-3)),)}, 1),
        ({"segments": (Segment("s", length=_LENGTH, outer_diameter=_DIAMETER, rest=RestShape(0.5, 0.0)),)}, 1),
        ({"cables": arm().cables[:2]}, 2),  # their mirror
        ({"cables": (*arm().cables[:2], dataclasses.replace(arm().cables[2], friction=0.1))}, 2),
        ({"cables": (*arm().cables[:2], dataclasses.replace(arm().cables[2], angle=4.0))}, 1),
    ],
)
def test_a_robot_that_is_not_the_same_from_every_side_has_fewer_symmetries(change, number):
    robot = dataclasses.replace(arm(), **change)
    assert len(symmetries(robot, rest_target(robot))) == number


def test_a_robot_that_is_not_round_has_the_symmetries_of_its_mesh():
    material = Material(youngs_modulus=_MODULUS, poissons_ratio=0.4, density=_DENSITY)
    flat = Segment("s", length=_LENGTH, section=Section("ellipse", 1.5 * _DIAMETER, _DIAMETER), material=material)
    model = RobotModel(dataclasses.replace(arm(angles_deg=(0, 90, 180, 270)), segments=(flat,)))
    found = symmetries_of(model, rest_target(model.robot))
    assert len(found) == 4 and turns(found) == 2
    search = HoldSearch(model)
    assert len(search.symmetries) == 4
    one = search.answer(np.array([-0.6, 0.64, 0.48]))
    for symmetry in found[1:]:
        image, own = symmetry.of(one), search.answer(symmetry.of(one).direction)
        assert (image.held, image.binding, image.cable) == (own.held, own.binding, own.cable)
        assert image.demand == pytest.approx(own.demand, rel=0.01)
    bent = symmetries_of(model, rest_target(model.robot, 0.3, 0.0))
    assert len(bent) == 2 and np.allclose(bent[1].matrix, np.diag([1.0, -1.0, 1.0]))  # the mirror that the bend keeps


def test_a_target_off_the_axis_has_no_symmetries():
    assert len(symmetries(arm(), rest_target(arm(), 0.3, 0.0))) == 1


def test_the_sphere_has_its_poles_and_its_equator():
    points = sphere(12)
    inclination = np.degrees([angles(point)[0] for point in points]).round(6)
    assert len(points) == 46 and (inclination == 90.0).sum() == 12
    assert inclination.min() == 0.0 and inclination.max() == 180.0
    assert np.allclose(np.linalg.norm(points, axis=1), 1.0)


def test_a_robot_without_cables_is_refused():
    with pytest.raises(ValueError, match="has no cables"):
        holdability(dataclasses.replace(arm(), cables=()), options=HoldOptions(equator=4))


FILE = """
robot:
  name: rod
  segments:
    - {name: s, length_mm: 120, outer_diameter_mm: 10, material: {youngs_modulus_mpa: 1.5, poissons_ratio: 0.4, density: 1100}}
  elements: {around: 8, along: 4}
  cables:
    - {name: a, angle_deg: 0, radius_mm: 3.5, segment: s}
    - {name: b, angle_deg: 120, radius_mm: 3.5, segment: s}
    - {name: c, angle_deg: 240, radius_mm: 3.5, segment: s}
  limits: {tension_max: LIMIT}
"""


MICRO = {
    "name": "micro",
    "segments": [
        {"name": "m", "length_mm": 9, "outer_diameter_mm": 0.8, "lumen_diameter_mm": 0.3,
         "material": {"youngs_modulus_mpa": 1.4, "poissons_ratio": 0.49, "density": 965}}
    ],
    "cables": [{"name": n, "angle_deg": a, "radius_mm": 0.28, "segment": "m"} for n, a in (("a", 0), ("b", 120), ("c", 240))],
    "elements": {"around": 6, "along": 6},
    "limits": {"tension_max": 0.05, "displacement_min_mm": -2, "displacement_max_mm": 2},
}  # fmt: skip


@pytest.mark.slow
def test_info_prints_and_draws_the_answer(tmp_path, capsys):
    file, picture = tmp_path / "rod.yaml", tmp_path / "sphere.png"
    file.write_text(FILE.replace("LIMIT", "0.5"), encoding="utf-8")
    assert main(["model", "info", str(file), "--directions", "4", "--picture", str(picture), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    hold = figures["hold"]
    assert hold["held"] is False and 0.0 < hold["held_share"] < 1.0 and "tension limit of 0.5 N" in hold["sentence"]
    assert hold["worst"]["binding"] == "tension" and hold["needed"]["tension_n"] > 0.5
    assert len(hold["directions"]) == len(sphere(4)) + 1
    play = figures["play"]
    assert play["large"] == (play["of_sag_pct"] > 10.0) and play["cable_mm"] == pytest.approx(
        np.radians(play["backlash_deg"]) * play["capstan_radius_mm"]
    )
    assert {"inclination_deg", "azimuth_deg", "demand", "lateral_mm", "eigenvalue"} <= set(hold["directions"][0])
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_backlash_leaves_more_than_the_sag_of_a_robot_that_hardly_sags_unless_capstans_follow_from_it(tmp_path):
    """A tube of 0.8 mm with capstans of 5 mm, and with those that follow from it."""
    plays = []
    for drive in ({"capstan_radius_mm": 5.0}, {}):
        path = tmp_path / "micro.yaml"
        path.write_text(yaml.safe_dump({"robot": MICRO, "hardware": {"drive": drive}}), encoding="utf-8")
        file = load_robot_file(path)
        sag = Simulator(file.robot, reduced=False).solve(np.array([-9.81, 0.0, 0.0]))
        plays.append(play_of(file.hardware, sag.response, np.array([0.0, 0.0, 1.0]), abs(sag.tip_position[0])))
    # A cable at the distance r from the axis turns a beam by d / r (1 + I / A r^2): it shortens it as well.
    expected = 0.5 * 9.0 * np.radians(0.6) * 5.0 / 0.28 / (1.0 + (0.8**2 + 0.3**2) / 16 / 0.28**2)
    coarse, fine = plays
    assert 1e3 * coarse.tip == pytest.approx(expected, rel=0.05)
    assert coarse.large and coarse.share > 1.0 and "worse than when released" in coarse.text()
    assert fine.share < 1.0 and fine.capstan == pytest.approx(0.2e-3) and fine.tip == pytest.approx(0.04 * coarse.tip)


def test_info_leaves_it_out_on_demand(tmp_path, capsys):
    file = tmp_path / "rod.yaml"
    file.write_text(FILE.replace("LIMIT", "0.5"), encoding="utf-8")
    assert main(["model", "info", str(file), "--no-hold", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["hold"] is None and figures["motors"]["tension_n"] > 0.5 and figures["motors"]["advice"] == ""
    assert main(["model", "info", str(file), "--no-hold", "--picture", "x.png"]) == 2
    assert "--no-hold" in capsys.readouterr().err
    assert main(["model", "info", str(file), "--directions", "3"]) == 2
    assert "allowed: 4 to 180" in capsys.readouterr().err


def test_motors_that_are_weaker_than_the_limit_of_tension_are_named(tmp_path):
    motors = [{"cable": "a", "can_id": 1, "also": {"b": -2.0}}, {"cable": "c", "can_id": 2}]
    drive = {"capstan_radius_mm": 3.0, "current_limit": 0.05}
    path = tmp_path / "weak.yaml"
    path.write_text(yaml.safe_dump({"robot": MICRO, "hardware": {"drive": drive, "motors": motors}}), encoding="utf-8")
    hardware = load_robot_file(path).hardware
    assert hardware.weakest_tension == pytest.approx(0.05 * 0.18 / 3e-3 / 2.0)
    assert weak_motors(hardware, Limits(tension_max=1.4)) == ""
    assert "pull 1.5 N at most, at their current limit of 0.05 A" in weak_motors(hardware, Limits(tension_max=1.6))


@pytest.fixture
def promptly(monkeypatch: pytest.MonkeyPatch) -> None:
    """With processes of usual priority: at the lowest one they wait seconds to minutes for the other tests."""
    monkeypatch.setattr(background, "give_way", lambda: None)


@pytest.mark.usefixtures("promptly")
def test_a_loop_asks_a_process_of_its_own():
    question = HoldProcess(arm(tension_max=0.5), np.array([-9.81, 0.0, 0.0]), straight_target(_LENGTH))
    while question.running:
        time.sleep(0.02)
    verdict = question.poll()
    assert not verdict.held and "tension limit" in verdict.sentence
    assert question.poll() is None  # once
    question.stop()


@pytest.mark.usefixtures("promptly")
@pytest.mark.parametrize(("cables", "ended"), [(3, True), (0, False)])
def test_a_question_that_is_ended_or_fails_has_no_answer(cables, ended):
    robot = arm()
    question = HoldProcess(
        dataclasses.replace(robot, cables=robot.cables[:cables]), np.array([-9.81, 0.0, 0.0]), straight_target(_LENGTH)
    )
    if ended:
        question.stop()
    while question.running:
        time.sleep(0.02)
    assert question.poll() is None


@pytest.mark.usefixtures("promptly")
def test_a_process_that_hangs_or_cannot_be_started_has_no_answer(monkeypatch):
    """A lock that another thread holds at the fork stays locked: the kernel ends the process."""
    lock, question = threading.Lock(), (arm(), np.array([-9.81, 0.0, 0.0]), straight_target(_LENGTH))
    monkeypatch.setattr(background, "_answer", lambda *_: lock.acquire())
    monkeypatch.setattr(background, "_LONGEST", 1)
    with lock:
        waiting = HoldProcess(*question)
        end = time.monotonic() + 30.0
        while waiting.running and time.monotonic() < end:
            time.sleep(0.02)
    assert not waiting.running and waiting.poll() is None

    def fail() -> int:
        raise BlockingIOError("too many processes")

    monkeypatch.setattr(os, "fork", fail)
    refused = HoldProcess(*question)
    assert not refused.running and refused.poll() is None


@pytest.fixture(scope="module")
def soft():
    """A rod of 500 mm that would sag by 60 lengths: no 2 % of gravity lead from one of its equilibria to the next."""
    material = Material(youngs_modulus=0.05e6, poissons_ratio=0.45, density=1070.0)
    segment = Segment("s", length=0.5, outer_diameter=30e-3, material=material)
    cables = tuple(Cable(f"c{k}", angle=np.radians(120 * k), radius=12e-3, segment="s") for k in range(3))
    limits = Limits(tension_max=20.0, displacement_max=0.3, displacement_min=-0.3)
    return HoldSearch(
        RobotModel(Robot("soft", segments=(segment,), cables=cables, limits=limits, elements=Elements(around=8, along=5)))
    )


def test_the_path_of_a_long_soft_robot_is_followed_until_its_cables_do_not_hold_it(soft):
    found = soft.answer(np.array([-0.5, 0.0, np.sqrt(0.75)]))
    assert found.known and found.binding == Binding.CABLES and 0.03 < found.share < 0.1
    hanging = soft.answer(np.array([0.0, 0.0, 1.0]))
    assert hanging.held and hanging.lateral < soft.tolerance


def test_a_search_that_ends_is_no_answer(soft, monkeypatch):
    """Neither yes nor no, in the sentence, the lines and the mapping; another direction that is refuted says no."""
    monkeypatch.setattr(path, "_MOST_STEPS", 2)
    lost = holdability(soft.model, directions=[[-0.5, 0.0, np.sqrt(0.75)]], with_needed=False)
    assert not lost.directions[0].known and not lost.held and not lost.refuted
    assert lines(soft.robot, lost)[0].startswith("can it be held: not found; whether the cables hold the tip")
    assert "the search ended at 4 % of gravity" in sentence(soft.robot, lost)
    assert as_json(soft.robot, lost)["known"] is False and as_json(soft.robot, lost)["directions"][0]["known"] is False
    refuted = dataclasses.replace(lost.directions[0], binding=Binding.BUCKLING)
    both = dataclasses.replace(lost, directions=(lost.directions[0], refuted), worst=1)
    assert refuted.severity > lost.directions[0].severity > 1.0
    assert lines(soft.robot, both)[0].startswith("can it be held: no;") and "not found in 1 directions" in sentence(
        soft.robot, both
    )
