"""Motors, capstans and channels of a robot whose file has none: they follow from the robot."""

import dataclasses
import math
import re

import pytest
import yaml

from gravcomp.calibration.apply import write_calibrated
from gravcomp.config import ConfigError
from gravcomp.description import Disks, Fibres, Payload, PointLoad, load_robot_file
from gravcomp.description.drive import COUNTS_PER_TURN, Drive
from gravcomp.description.own_weight import bend_by_own_weight
from gravcomp.motors.encoder import Encoder

STANDARD = Drive()


@pytest.fixture
def robot(tmp_path):
    """Make a robot file without motors: a tube with cables at 0.7 of its radius."""

    def make(length, diameter, modulus, drive=None, hardware=None, **limits):
        material = {"youngs_modulus_mpa": modulus, "poissons_ratio": 0.49, "density": 1000}
        body = {
            "name": "tube",
            "segments": [{"name": "s", "length_mm": length, "outer_diameter_mm": diameter, "material": material}],
            "cables": [
                {"name": n, "angle_deg": a, "radius_mm": 0.35 * diameter, "segment": "s"}
                for n, a in (("a", 0), ("b", 120), ("c", 240))
            ],
            "limits": limits,
        }
        path = tmp_path / "tube.yaml"
        path.write_text(yaml.safe_dump({"robot": body, "hardware": {"drive": drive or {}, **(hardware or {})}}), encoding="utf-8")
        return load_robot_file(path)

    return make


def test_a_tube_bends_by_its_weight_as_a_cantilever(robot):
    # q L^3 / (6 E I), with I / A = d^2 / 16
    expected = 1000 * 9.80665 * 0.05**3 / (6 * 2e6 * 0.004**2 / 16)
    assert bend_by_own_weight(robot(50, 4, 2.0).robot) == pytest.approx(expected, rel=2e-3)


def test_what_a_robot_carries_and_its_fibres_count_in_its_bend(robot):
    tube = dataclasses.replace(robot(50, 4, 2.0).robot, cables=())  # which would run inside a backbone
    stiffness = 2e6 * math.pi / 64 * 0.004**4
    segment = tube.segments[0]
    disks = dataclasses.replace(segment, disks=Disks(count=1, outer_diameter=8e-3, mass=1e-3))
    for loaded, place in (
        (dataclasses.replace(tube, segments=(disks,)), 0.05),
        (dataclasses.replace(tube, loads=(PointLoad((0.0, 0.0, 0.02), 1e-3),)), 0.02),
        (dataclasses.replace(tube, payload=Payload(1e-3)), 0.05),
    ):
        more = bend_by_own_weight(loaded) - bend_by_own_weight(tube)
        assert more == pytest.approx(1e-3 * 9.80665 * place**2 / (2 * stiffness), rel=2e-3)
    braid = tube.with_material(fibres=Fibres(4.0, 0.0))
    assert bend_by_own_weight(braid) == pytest.approx(bend_by_own_weight(tube) / 5.0)


def test_a_tube_from_a_file_gets_the_capstans_of_the_described_one(robot, tmp_path):
    creation = pytest.importorskip("trimesh.creation")
    described = robot(50, 4, 2.0)
    section = described.sections["robot"]
    tube = creation.cylinder(2.0, 50.0, sections=48)
    tube.apply_translation([0.0, 0.0, 25.0])
    tube.export(tmp_path / "tube.stl")

    def capstan(file):
        body = {"file": file, "length_mm": 50.0, "material": section["segments"][0]["material"], "axis": "auto"}
        cables = [{"end_mm": 50.0} | {k: v for k, v in cable.items() if k != "segment"} for cable in section["cables"]]
        path = tmp_path / "from_file.yaml"
        path.write_text(yaml.safe_dump({"robot": {"name": "tube", "body": body, "cables": cables}}), encoding="utf-8")
        return load_robot_file(path).hardware.drive.capstan_radius

    radius = described.hardware.drive.capstan_radius
    assert radius < 0.5 * STANDARD.capstan_radius
    assert capstan("tube.stl") == pytest.approx(radius, rel=0.02)  # the surface has flat sides
    assert capstan("gone.stl") == STANDARD.capstan_radius  # refused where the body is needed


@pytest.mark.parametrize(("length", "diameter", "modulus"), [(50, 4, 2.0), (40, 8, 0.3), (120, 6, 1.0)])
def test_backlash_turns_the_tip_by_little_of_what_its_weight_does(robot, length, diameter, modulus):
    file = robot(length, diameter, modulus)
    drive, pitch = file.hardware.drive, 0.35e-3 * diameter
    turned = drive.backlash * drive.capstan_radius / pitch
    assert drive.capstan_radius <= STANDARD.capstan_radius
    assert turned <= 0.0201 * bend_by_own_weight(file.robot)


def test_a_small_capstan_has_the_position_loop_of_the_same_rotor(robot):
    drive = robot(50, 4, 2.0).hardware.drive
    assert drive.capstan_radius < STANDARD.capstan_radius
    for gain in ("velocity_gain", "velocity_integral"):
        per_turn = getattr(drive, gain) * drive.capstan_radius
        assert per_turn == pytest.approx(getattr(STANDARD, gain) * STANDARD.capstan_radius)


@pytest.mark.parametrize("drive", [{}, {"capstan_radius_mm": 0.5}, {"gear_ratio": 100.0, "backlash_deg": 0.0}])
@pytest.mark.parametrize("described", [False, True])
def test_the_feedback_tells_the_turns_of_a_rotor_at_its_largest_speeds(robot, drive, described):
    motors = {"motors": MOTORS} if described else None
    hardware = robot(50, 4, 2.0, drive=drive, hardware=motors, displacement_rate_mm_s=200.0).hardware
    for speed in (hardware.drive.velocity_limit, hardware.homing.velocity):
        rpm = 60.0 * speed / (COUNTS_PER_TURN * hardware.drive.travel_per_count)
        encoder, way = Encoder(), 0.0
        for k in range(200):  # 0.4 s at 500 Hz; every tenth frame is lost
            way = COUNTS_PER_TURN * rpm / 60.0 * 0.002 * k
            if k % 10 != 9:
                assert encoder.update(round(way) % COUNTS_PER_TURN, 1.1 * rpm, 0.0, 0.002 * k)  # the loop overshoots
            assert encoder.certain
        assert encoder.count == pytest.approx(way, abs=0.2 * COUNTS_PER_TURN)


def test_a_robot_that_hardly_sags_gets_the_smallest_capstan_and_what_is_given_stays(robot):
    assert robot(9, 4, 50.0).hardware.drive.capstan_radius == pytest.approx(0.2e-3)
    given = robot(9, 4, 50.0, drive={"capstan_radius_mm": 3.0, "velocity_gain": 80.0}).hardware.drive
    assert (given.capstan_radius, given.velocity_gain) == (pytest.approx(3e-3), 80.0)


def test_gears_without_backlash_need_no_small_capstan(robot):
    assert robot(9, 4, 50.0, drive={"backlash_deg": 0.0}).hardware.drive.capstan_radius == STANDARD.capstan_radius


def test_motors_reach_the_tension_and_the_stroke_of_a_large_robot(robot):
    limits = {"tension_max": 300.0, "displacement_min_mm": -300.0, "displacement_max_mm": 300.0}
    drive = robot(1000, 80, 0.6, **limits).hardware.drive
    assert drive.capstan_radius == STANDARD.capstan_radius and drive.tension_limit == 300.0
    assert (drive.displacement_min, drive.displacement_max) == (pytest.approx(-0.3), pytest.approx(0.3))
    assert drive.current_limit * drive.tension_per_ampere >= 1.4 * 300.0 and drive.current_limit <= 10.0
    assert math.isclose(drive.torque_constant, 0.225)


def test_joints_that_are_real_motors_keep_the_standard_capstan(robot):
    motors = [{"cable": name, "joint": f"motor_{name}"} for name in "abc"]
    drive = robot(9, 4, 50.0, hardware={"joints": {"controller": "winches", "motors": motors}}).hardware.drive
    assert (drive.capstan_radius, drive.velocity_gain) == (STANDARD.capstan_radius, STANDARD.velocity_gain)


@pytest.mark.parametrize("tension", [0.05, 3.0, 5.0, 20.0, 300.0])
@pytest.mark.parametrize(("length", "diameter", "modulus"), [(9, 4, 50.0), (40, 8, 0.3), (1000, 80, 0.6)])
def test_homing_pulls_no_more_than_the_robot_stands_or_is_refused(robot, length, diameter, modulus, tension):
    hardware = robot(length, diameter, modulus, tension_max=tension).hardware
    pull = hardware.homing.current_rise * hardware.drive.tension_per_ampere
    assert hardware.homing.tension_max == tension and hardware.homing.current_rise <= 0.06
    assert pull <= tension or f"{tension:g} N are allowed" in hardware.strong_homing
    assert bool(hardware.strong_homing) == (pull > tension)


def test_a_small_capstan_with_the_standard_homing_is_refused(robot):
    hardware = robot(40, 8, 0.3, drive={"capstan_radius_mm": 0.2}, hardware={"homing": {"current_rise": 0.06}}).hardware
    assert "54 N before it counts as taut, and 5 N are allowed" in hardware.strong_homing
    assert "may be 0.0055 A" in hardware.strong_homing and "A larger capstan" in hardware.strong_homing


@pytest.mark.parametrize("tension", [1.0, 5.0])
def test_a_refused_homing_says_that_the_capstans_are_assumed_and_what_would_be_allowed(robot, tension):
    motors = {"motors": MOTORS}
    refused = robot(50, 4, 2.0, hardware=motors, tension_max=tension).hardware
    assert "capstans of 0.27 mm are assumed" in refused.strong_homing
    assert "the virtual robot needs no homing" in refused.strong_homing
    rise = re.search(r"current_rise may be ([\d.]+) A", refused.strong_homing)
    assert (rise is None) == (tension == 1.0)  # 0.0015 A is less than the key may be
    if rise:
        homed = robot(50, 4, 2.0, hardware=motors | {"homing": {"current_rise": float(rise[1])}}, tension_max=tension)
        assert not homed.hardware.strong_homing


def test_the_article_is_homed():
    assert not load_robot_file("article").hardware.strong_homing


MOTORS = [{"cable": name, "can_id": k} for k, name in enumerate("abc", start=1)]


def test_described_motors_without_capstans_get_ones_that_suit_the_virtual_robot_only(robot):
    file = robot(50, 4, 2.0, hardware={"motors": MOTORS})
    drive = file.hardware.drive
    assert drive.capstan_radius == robot(50, 4, 2.0).hardware.drive.capstan_radius < STANDARD.capstan_radius
    assert drive.velocity_gain * drive.capstan_radius == pytest.approx(STANDARD.velocity_gain * STANDARD.capstan_radius)
    assert drive.current_limit == STANDARD.current_limit
    assert file.hardware.homing.current_rise * drive.tension_per_ampere <= 5.0 or file.hardware.strong_homing
    file.require_motors("virtual")
    with pytest.raises(ConfigError, match=r"capstan_radius_mm has not been measured.*Give the radius"):
        file.require_motors("socketcan")


def test_described_capstans_are_those_of_real_motors(robot):
    file = robot(50, 4, 2.0, drive={"capstan_radius_mm": 2.0}, hardware={"motors": MOTORS})
    file.require_motors("socketcan")
    drive = file.hardware.drive
    assert (drive.capstan_radius, drive.velocity_gain) == (pytest.approx(2e-3), pytest.approx(2.5 * STANDARD.velocity_gain))
    standard = robot(200, 12, 0.5, hardware={"motors": MOTORS})
    standard.require_motors("socketcan")
    assert standard.hardware.drive == STANDARD


def test_motors_that_move_cables_farther_get_smaller_capstans(robot):
    geared = [{**motor, "ratio": 2.0} for motor in MOTORS]
    one, two = (robot(80, 5, 1.5, hardware={"motors": motors}).hardware.drive for motors in (MOTORS, geared))
    assert two.capstan_radius == pytest.approx(one.capstan_radius / 2.0, abs=1e-5)


def test_assumed_capstans_reach_the_largest_tension_with_the_described_current(robot):
    drive = robot(300, 12, 0.3, drive={"current_limit": 0.5}, hardware={"motors": MOTORS}, tension_max=40.0).hardware.drive
    assert drive.current_limit * drive.tension_per_ampere >= 1.4 * 40.0


def test_buses_without_a_channel_get_one_each(robot):
    buses = [{"name": "left"}, {"name": "right"}]
    hardware = robot(50, 4, 2.0, hardware={"buses": buses, "motors": [{**m, "bus": "left"} for m in MOTORS]}).hardware
    assert len({bus.channel for bus in hardware.all_buses}) == 2


@pytest.mark.parametrize("hardware", [None, {"motors": MOTORS}])
def test_a_calibrated_file_keeps_the_capstans_that_were_assumed_for_its_data(robot, tmp_path, hardware):
    file = robot(80, 5, 1.5, hardware=hardware)
    segment = file.robot.segments[0]
    softer = dataclasses.replace(segment, material=dataclasses.replace(segment.material, youngs_modulus=1.2e6))
    target = tmp_path / "calibrated.yaml"
    write_calibrated(file.source, target, file.robot, dataclasses.replace(file.robot, segments=(softer,)), file.hardware)
    calibrated = load_robot_file(target)
    assert calibrated.robot.segments[0].material.youngs_modulus == pytest.approx(1.2e6)
    assert dataclasses.astuple(calibrated.hardware.drive) == pytest.approx(dataclasses.astuple(file.hardware.drive))
    with pytest.raises(ConfigError, match="socketcan"):
        calibrated.require_motors("socketcan")
