"""Data that cannot be of the described robot are named and refused; calibrated files stand on the robot file."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gravcomp.calibration.apply import write_mount
from gravcomp.calibration.measured import Measured, MeasurementError, StillWindows
from gravcomp.calibration.parameters import starting_parameters
from gravcomp.calibration.plan import gravity_of
from gravcomp.calibration.plausible import check_explained, check_frame, check_time, check_units
from gravcomp.calibration.standstill import Standstill
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
    return Robot(
        "short", segments=(segment,), cables=cables, elements=elements, limits=Limits(tension_max=2.0, displacement_max=5e-3)
    )


def predicted(robot: Robot, windows: StillWindows) -> np.ndarray:
    """The tips (k, 6) of the robot in the windows."""
    return StaticPredictor(robot, windows).predict(starting_parameters(robot, ())).tip


@pytest.fixture(scope="module")
def windows(robot):
    """The tips of the described robot in six poses, each cable pulled in twice."""
    wound = np.full((6, 3), np.nan)
    wound[np.arange(6), np.arange(6) % 3] = 2e-3
    gravity = np.array([gravity_of(0.2 * k - 0.4, 1.1 * k) for k in range(6)])
    tip = predicted(robot, StillWindows(gravity, wound, np.zeros((6, 3))))
    return StillWindows(gravity, wound, tip[:, :3] * 1.01, tip[:, 3:])


@pytest.fixture(scope="module")
def tip(windows):
    """The tips (k, 6) of the described robot in these poses."""
    return np.hstack([windows.tip_position / 1.01, windows.tip_direction])


@pytest.fixture(scope="module")
def checked(robot, windows):
    """Checks the frame and the cables of other windows in the same poses."""
    predictor = StaticPredictor(robot, windows)
    tips_of = functools.cache(lambda shape, wound: predictor.tips_of(np.frombuffer(wound).reshape(shape)))

    def check(other: StillWindows) -> None:
        def tips(displacement: np.ndarray) -> np.ndarray:
            return tips_of(displacement.shape, displacement.tobytes())

        check_frame(robot, other, tips(other.displacement), tips)

    return check


def test_data_of_the_robot_pass(robot, windows, checked):
    check_units(robot, windows, "here")
    checked(windows)


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
def test_a_wrong_frame_is_named(windows, axes, message, checked):
    turned = dataclasses.replace(windows, tip_position=windows.tip_position @ axes.T)
    with pytest.raises(MeasurementError, match=message):
        checked(turned)


def test_swapped_cables_are_named(windows, checked):
    swapped = dataclasses.replace(windows, displacement=windows.displacement[:, [0, 2, 1]])
    with pytest.raises(MeasurementError, match="cables c1 and c2 are swapped"):
        checked(swapped)


def test_cables_that_are_swapped_in_turn_are_named(windows, checked):
    swapped = dataclasses.replace(windows, displacement=windows.displacement[:, [1, 2, 0]])
    with pytest.raises(MeasurementError, match=r"cables c0, c1 and c2 are swapped.* is c0, "):
        checked(swapped)


@pytest.mark.parametrize(("factor", "words"), [(1e-3, "a thousand times too small"), (0.1, "ten times too small")])
def test_displacements_in_other_units_are_named(windows, factor, words, checked):
    with pytest.raises(MeasurementError, match=f"displacements of the cables are {words}"):
        checked(dataclasses.replace(windows, displacement=factor * windows.displacement))


def test_a_frame_that_is_turned_or_moved_is_named(robot, windows, tip):
    check_explained(robot, windows, tip)
    turn = Rotation.from_rotvec([0.0, 0.0, np.radians(30.0)])
    for moved in (turn.apply(windows.tip_position), windows.tip_position + np.array([0.0, 4e-3, 0.0])):
        with pytest.raises(MeasurementError, match="in another frame than soft_base: turned by"):
            check_explained(robot, dataclasses.replace(windows, tip_position=moved), tip)


def test_what_no_values_explain_is_of_another_robot(robot, windows, tip):
    wild = 0.03 * robot.length * np.random.default_rng(1).standard_normal(windows.tip_position.shape)
    with pytest.raises(MeasurementError, match="another robot"):
        check_explained(robot, dataclasses.replace(windows, tip_position=windows.tip_position + wild), tip)


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_times_in_other_units_are_named(robot, factor):
    count = 200
    course = Measured(
        "here", np.zeros(count, int), 0.05 * np.arange(count), np.tile([-9.81, 0, 0], (count, 1)), np.full((count, 3), np.nan),
        np.tile([0, 0, robot.length], (count, 1)),
    )  # fmt: skip
    still = Standstill.of(robot, 0.2)
    check_time(course, still)
    with pytest.raises(MeasurementError, match="Are the times in ms"):
        check_time(dataclasses.replace(course, time=factor * course.time), still)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tip_direction": np.nan}, "tip_direction has values that are not finite"),
        ({"gravity": np.inf}, "gravity has values that are not finite"),
        ({"displacement": np.inf}, "displacement has values that are infinite"),
        ({"time": 0.0}, "the time goes from 0 to 0 s; it must increase"),
    ],
)
def test_what_is_no_number_is_named(change, message):
    values = {
        "time": np.arange(3.0), "gravity": np.tile([-9.81, 0, 0], (3, 1)), "displacement": np.zeros((3, 1)),
        "tip_position": np.ones((3, 3)), "tip_direction": np.ones((3, 3)),
    }  # fmt: skip
    with pytest.raises(MeasurementError, match=message):
        Measured("here", np.zeros(3, int), **values | {name: np.full_like(values[name], x) for name, x in change.items()})


def test_a_file_stands_on_another_one(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "base: article\nrobot:\n  segments:\n    - {name: distal, material: {youngs_modulus_mpa: 0.7}}\n"
        "  cables:\n    - {name: s1c2, axial_stiffness: 500, material: null, diameter_mm: null}\n",
        encoding="utf-8",
    )
    mine, base = load_robot_file(tmp_path / "mine.yaml"), load_robot_file("article")
    assert [m.youngs_modulus for m in mine.robot.materials] == pytest.approx([0.8e6, 0.7e6])
    assert mine.robot.cables[1].axial_stiffness == 500.0
    assert mine.robot.cables[0] == base.robot.cables[0] and mine.section("hardware") == base.section("hardware")


def test_the_virtual_robot_of_a_base_in_another_folder_is_found(tmp_path):
    (tmp_path / "measured").mkdir()
    (tmp_path / "measured" / "first.yaml").write_text("base: article\nvirtual_robot: {seed: 7}\n", encoding="utf-8")
    (tmp_path / "measured" / "fitted.yaml").write_text(
        "base: first.yaml\nvirtual_robot: {description: first.yaml}\n", encoding="utf-8"
    )
    (tmp_path / "mine.yaml").write_text("base: measured/fitted.yaml\n", encoding="utf-8")
    assert described(load_robot_file(tmp_path / "mine.yaml")).seed == 7


def test_a_mount_that_is_written_into_another_folder_leads_to_the_same_files(tmp_path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "first.yaml").write_text("base: article\nvirtual_robot: {seed: 7}\n", encoding="utf-8")
    (tmp_path / "robots" / "mine.yaml").write_text(
        "# mine\nbase: first.yaml\nvirtual_robot: {description: first.yaml}\n", encoding="utf-8"
    )
    write_mount(tmp_path / "robots" / "mine.yaml", tmp_path / "mounted.yaml", (0.0, 0.1, 0.0))
    mounted = load_robot_file(tmp_path / "mounted.yaml")
    assert mounted.robot.imu_mount.rpy[1] == pytest.approx(0.1, abs=1e-6) and described(mounted).seed == 7
    assert (tmp_path / "mounted.yaml").read_text(encoding="utf-8").startswith("# mine")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("base: nowhere.yaml", "base: nowhere.yaml: does not exist"),
        ("base: [article]", "base is .*; the path of a robot file"),
        ("base: mine.yaml", "stands on this file"),
    ],
)
def test_a_base_that_is_none_is_refused(tmp_path, text, message):
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message):
        load_robot_file(tmp_path / "mine.yaml")


def test_an_empty_value_removes_a_key():
    assert merged({"a": 1, "b": {"c": 2, "d": 3}}, {"b": {"c": None}, "e": 4}) == {"a": 1, "b": {"d": 3}, "e": 4}
