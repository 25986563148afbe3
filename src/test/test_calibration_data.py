"""Data that cannot be of the described robot are named and refused; calibrated files stand on the robot file."""

import dataclasses

import numpy as np
import pytest

from gravcomp.calibration.apply import write_mount
from gravcomp.calibration.fit import starting_parameters
from gravcomp.calibration.measured import MeasurementError, StillWindows
from gravcomp.calibration.plan import gravity_of
from gravcomp.calibration.plausible import check_explained, check_frame, check_units
from gravcomp.calibration.statics import StaticPredictor
from gravcomp.config import ConfigError
from gravcomp.description import Cable, Elements, Limits, Material, Robot, Segment, load_robot_file
from gravcomp.description.overlay import merged
from gravcomp.virtual.described import described


@pytest.fixture(scope="module")
def robot():
    segment = Segment("s", length=0.08, outer_diameter=0.01, lumen_diameter=0.004, material=Material(youngs_modulus=0.8e6))
    cables = tuple(Cable(f"c{i}", np.radians(90.0 * i), 3.5e-3, segment="s") for i in range(3))
    elements = Elements(around=6, along=4, radial=1)
    return Robot("short", segments=(segment,), cables=cables, elements=elements, limits=Limits(tension_max=2.0))


def predicted(robot: Robot, windows: StillWindows) -> np.ndarray:
    """The tips (k, 6) of the robot in the windows."""
    return StaticPredictor(robot, windows).predict(starting_parameters(robot, ())).tip


@pytest.fixture(scope="module")
def windows(robot):
    """The tips of the described robot in six poses, each cable pulled in twice."""
    wound = np.full((6, 3), np.nan)
    wound[np.arange(6), np.arange(6) % 3] = 2e-3
    gravity = np.array([gravity_of(0.2 * k - 0.4, 1.1 * k) for k in range(6)])
    empty = StillWindows(gravity, wound, np.zeros((6, 3)))
    tip = predicted(robot, empty)
    return StillWindows(gravity, wound, tip[:, :3] * 1.01, tip[:, 3:])


def checked(robot: Robot, windows: StillWindows) -> None:
    check_frame(robot, windows, predicted(robot, windows), lambda other: predicted(robot, other))


def test_data_of_the_robot_pass(robot, windows):
    check_units(robot, windows, "here")
    checked(robot, windows)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gravity": 1 / 9.81}, r"gravity is 1 m/s\^2 long \(in g"),
        ({"tip_position": 1e3}, "a thousand times too large"),
        ({"tip_position": 1e-3}, "a thousand times too small"),
        ({"tip_position": 1 / 25.4}, "inches"),
        ({"tip_position": 1.6}, "another robot"),
        ({"displacement": 1e3}, "c.*displaced by 2000 mm.*other units"),
    ],
)
def test_other_units_are_named(robot, windows, change, message):
    scaled = {name: factor * getattr(windows, name) for name, factor in change.items()}
    with pytest.raises(MeasurementError, match=message):
        check_units(robot, dataclasses.replace(windows, **scaled), "a cable")


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (np.diag([1.0, -1.0, 1.0]), "mirrored.* x, -y, z"),
        (np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), "another frame"),
        (np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), "another frame"),
    ],
)
def test_a_wrong_frame_is_named(robot, windows, axes, message):
    turned = dataclasses.replace(windows, tip_position=windows.tip_position @ axes.T)
    with pytest.raises(MeasurementError, match=message):
        checked(robot, turned)


def test_swapped_cables_are_named(robot, windows):
    swapped = dataclasses.replace(windows, displacement=windows.displacement[:, [0, 2, 1]])
    with pytest.raises(MeasurementError, match="cables c1 and c2 are swapped"):
        checked(robot, swapped)


def test_what_no_values_explain_is_of_another_robot(robot):
    check_explained(robot, 0.02 * robot.length)
    with pytest.raises(MeasurementError, match="another robot"):
        check_explained(robot, 0.05 * robot.length)


def test_a_file_stands_on_another_one(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "base: article\nrobot:\n  segments:\n    - {name: distal, material: {youngs_modulus_mpa: 0.7}}\n"
        "  cables:\n    - {name: s1c2, axial_stiffness: 500, material: null, diameter_mm: null}\n"
    )
    mine, base = load_robot_file(tmp_path / "mine.yaml"), load_robot_file("article")
    assert [m.youngs_modulus for m in mine.robot.materials] == pytest.approx([0.8e6, 0.7e6])
    assert mine.robot.cables[1].axial_stiffness == 500.0
    assert mine.robot.cables[0] == base.robot.cables[0] and mine.section("hardware") == base.section("hardware")


def test_the_virtual_robot_of_a_base_in_another_folder_is_found(tmp_path):
    (tmp_path / "measured").mkdir()
    (tmp_path / "measured" / "first.yaml").write_text("base: article\nvirtual_robot: {seed: 7}\n")
    (tmp_path / "measured" / "fitted.yaml").write_text("base: first.yaml\nvirtual_robot: {description: first.yaml}\n")
    (tmp_path / "mine.yaml").write_text("base: measured/fitted.yaml\n")
    assert described(load_robot_file(tmp_path / "mine.yaml")).seed == 7


def test_a_mount_that_is_written_into_another_folder_leads_to_the_same_files(tmp_path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "first.yaml").write_text("base: article\nvirtual_robot: {seed: 7}\n")
    (tmp_path / "robots" / "mine.yaml").write_text("# mine\nbase: first.yaml\nvirtual_robot: {description: first.yaml}\n")
    write_mount(tmp_path / "robots" / "mine.yaml", tmp_path / "mounted.yaml", (0.0, 0.1, 0.0))
    mounted = load_robot_file(tmp_path / "mounted.yaml")
    assert mounted.robot.imu_mount.rpy[1] == pytest.approx(0.1, abs=1e-6) and described(mounted).seed == 7
    assert (tmp_path / "mounted.yaml").read_text().startswith("# mine")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("base: nowhere.yaml", "base: nowhere.yaml: does not exist"),
        ("base: [article]", "base is .*; the path of a robot file"),
        ("base: mine.yaml", "stands on this file"),
    ],
)
def test_a_base_that_is_none_is_refused(tmp_path, text, message):
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(ConfigError, match=message):
        load_robot_file(tmp_path / "mine.yaml")


def test_an_empty_value_removes_a_key():
    assert merged({"a": 1, "b": {"c": 2, "d": 3}}, {"b": {"c": None}, "e": 4}) == {"a": 1, "b": {"d": 3}, "e": 4}
