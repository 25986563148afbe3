"""A robot file is read into SI units; the error for a mistake names file and key, and says what was found and what is allowed."""

import copy

import numpy as np
import pytest
import yaml

from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file, shipped_robots


@pytest.fixture
def document():
    return copy.deepcopy(yaml.safe_load(shipped_robots()["article"].read_text(encoding="utf-8")))


def load(document, folder):
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return load_robot_file(path)


def test_article_robot():
    robot = load_robot_file("article").robot
    assert robot.length == pytest.approx(0.1)
    assert robot.cable_names == ("s1c1", "s1c2", "s1c3", "s2c1", "s2c2", "s2c3")
    assert [robot.cable_end(c) for c in robot.cables] == pytest.approx([0.05] * 3 + [0.1] * 3)
    assert robot.segments[0].material.youngs_modulus == pytest.approx(0.8e6)


@pytest.mark.parametrize("name", shipped_robots())
def test_every_shipped_robot_is_read(name):
    assert load_robot_file(name).robot.cables


def test_other_sections_are_returned_as_they_are(document, tmp_path):
    document["hardware"] = {"motors": [1, 2], "drive": {"capstan_radius_mm": 5.0}}
    file = load(document, tmp_path)
    assert file.section("hardware") == {"motors": [1, 2], "drive": {"capstan_radius_mm": 5.0}}
    with pytest.raises(ConfigError, match="there is no section 'motor'"):
        file.section("motor")


def test_imu_mount_rotates_from_the_imu_into_the_base(document, tmp_path):
    document["robot"]["imu_mount"] = {"rpy_deg": [0.0, 0.0, 90.0]}
    rotation = load(document, tmp_path).robot.imu_mount.rotation
    assert rotation @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])
    document["robot"]["imu_mount"] = {"rpy_deg": [30.0, -70.0, 130.0]}
    rotation = load(document, tmp_path).robot.imu_mount.rotation
    assert rotation @ rotation.T == pytest.approx(np.eye(3)) and np.linalg.det(rotation) == pytest.approx(1.0)


def test_segments_in_another_unit_than_the_cables_are_named(document, tmp_path):
    for segment in document["robot"]["segments"]:
        segment["length_mm"] /= 10.0
    document["robot"]["cables"] = [{"name": "c", "angle_deg": 0.0, "radius_mm": 3.0, "end_mm": 95.0}]
    with pytest.raises(ConfigError, match=r"ends at 95 mm.* length 10 mm; the segments look like cm: they would be 100 mm long"):
        load(document, tmp_path)


def change(path, value):
    """Return a function that sets the entry at `path`, or removes it where the value is None."""

    def apply(robot):
        for step in path[:-1]:
            robot = robot[step]
        if value is None:
            del robot[path[-1]]
        else:
            robot[path[-1]] = value

    return apply


VIA_AND_START = {"name": "s1c2", "via_points_mm": [[0, 2, 5], [0, 2, 50]], "start_mm": 5}
BACKWARDS = {"name": "s1c2", "via_points_mm": [[0, 2, 50], [0, 2, 5]]}
MISTAKES = [
    (change(["segments", 0, "length_mm"], -5), ["robot.segments[0].length_mm", "-5", "1 to 5000 mm"]),
    (change(["segments", 1, "lumen_diameter_mm"], 9.5), ["robot.segments[1]", "lumen_diameter_mm is 9.5", "8.82"]),
    (change(["segments", 1, "name"], "proximal"), ["segments", "'proximal'", "2 times"]),
    (change(["segments", 0, "material", "law"], "mooney"), ["material.law", "mooney", "svk, neo_hookean"]),
    (change(["segments", 0, "material", "poissons_ratio"], 0.5), ["poissons_ratio", "0.5", "0 to 0.4999"]),
    (change(["cables", 2, "segment"], "distel"), ["cables[2] ('s1c3').segment", "distel", "proximal, distal"]),
    (change(["cables", 1, "radius_mm"], 5.0), ["cables[1] ('s1c2')", "5 mm", "1.8 to 4.5 mm"]),
    (change(["cables", 1, "end_mm"], 40.0), ["cables[1]", "one of segment and end_mm"]),
    (change(["cables", 1, "angle_deg"], None), ["cables[1]", "angle_deg"]),
    (change(["cables", 1, "name"], "s1c1"), ["cables", "'s1c1'", "2 times"]),
    (change(["limits", "tension_min"], 9.0), ["robot.limits", "tension_min is 9 N", "below tension_max = 5 N"]),
    (change(["cables", 1], VIA_AND_START), ["cables[1]", "via_points_mm and also", "start_mm"]),
    (change(["cables", 1, "via_points_mm"], [[0, 2, 0], [0, 2, 50]]), ["cables[1]", "via_points_mm and also"]),
    (change(["body"], {"file": "a.stl", "length_mm": 100.0}), ["both of segments and body"]),
    (change(["segments"], None), ["neither of segments and body"]),
    (change(["segments", 0, "material", "density"], 1.07), ["density is 1.07", "1.07 g/cm^3 would be 1070 kg/m^3"]),
    (
        change(["segments", 1, "material"], {"law": "yeoh", "c20_ratio": -0.5}),
        ["robot.segments[1].material: the law yeoh is not stable with c20_ratio: -0.5", "a sheet at a stretch of 1.18 falls"],
    ),
    (
        change(["segments", 1, "cap"], {"length_mm": 2, "material": {"law": "yeoh", "c30_ratio": -0.2}}),
        ["robot.segments[1].cap.material: the law yeoh is not stable", "from a stretch of 0.5 to 2"],
    ),
    (change(["segments", 0, "material", "c20_ratio"], 0.3), ["c20_ratio is 0.3, a constant of the law yeoh; the law svk has no"]),
    (
        change(["segments", 0, "material"], {"law": "yeoh", "c01_ratio": 0.1}),
        ["the law yeoh has c20_ratio, c30_ratio: leave c01_ratio out, or write law: mooney_rivlin"],
    ),
    (change(["name"], "../up"), ["robot: name is '../up', after which files", "1 to 100 characters, without /"]),
    (change(["name"], ""), ["robot: name is ''"]),
    (change(["cables", 1, "name"], " left"), ["cables[1].name is ' left'", "without spaces at the ends"]),
    (change(["segments", 0, "name"], "a\nb"), ["segments[0].name is 'a\\nb'"]),
    (change(["cables", 1, "angle_deg"], 0.0), ["'s1c1' and 's1c2' are the same line"]),
    (change(["cables", 1], BACKWARDS), ["cables[1]", "begin at z = 50 and end at 5", "farther from the base"]),
]


@pytest.mark.parametrize(("mistake", "words"), MISTAKES)
def test_the_error_names_the_mistake(document, tmp_path, mistake, words):
    mistake(document["robot"])
    with pytest.raises(ConfigError) as error:
        load(document, tmp_path)
    for word in ["robot.yaml", *words]:
        assert word in str(error.value)


def test_unknown_sections_and_missing_files_are_refused(document, tmp_path):
    document["motors"] = {}
    with pytest.raises(ConfigError, match="unknown key 'motors'; allowed: robot, scene, hardware, virtual_robot, nodes"):
        load(document, tmp_path)
    with pytest.raises(ConfigError, match=r"does not exist; give the path .* or the name of a shipped robot: article"):
        load_robot_file("artikle")


def test_a_renamed_key_is_refused_and_the_error_names_the_new_one(document, tmp_path):
    document["hardware"]["drive"]["displacement_minimum_mm"] = -20.0
    file = load(document, tmp_path)
    with pytest.raises(ConfigError) as error:
        _ = file.hardware
    for word in ["robot.yaml", "hardware.drive.displacement_minimum_mm", "renamed", "'displacement_min_mm'"]:
        assert word in str(error.value)


def test_the_hardware_of_a_file_fits_its_robot(document, tmp_path):
    document["hardware"]["motors"][0]["cable"] = "x"
    file = load(document, tmp_path)
    with pytest.raises(ConfigError, match=r"hardware.motors are for the cables x, .*; needed, in this order: s1c1, "):
        _ = file.hardware
