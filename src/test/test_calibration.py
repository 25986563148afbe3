"""Calibration: derivatives, recovery of known robots, warnings, data files, and the robot's YAML."""

import dataclasses

import numpy as np
import pytest

from gravcomp.calibration import one_mesh
from gravcomp.calibration.apply import calibrated_hardware, calibrated_imu, calibrated_robot, write_calibrated
from gravcomp.calibration.course import predict_course
from gravcomp.calibration.files import read_measured, write_csv
from gravcomp.calibration.fit import fit_statics
from gravcomp.calibration.measured import Measured, MeasurementError, StillWindows, still_windows
from gravcomp.calibration.parameters import StaticParameters, cable_compliance, starting_parameters, with_moduli
from gravcomp.calibration.standstill import Standstill
from gravcomp.calibration.statics import StaticPredictor
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import Fibres, load_robot_file
from gravcomp.description.robot import Payload
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.mesh.coarse import with_coarse_elements
from gravcomp.simulation import DynamicSimulator, DynamicsOptions, Simulator
from gravcomp.trials.known_robot import known_setup, known_windows, offsets

GROUPS = {"offsets", "compliance", "winding"}
GRAVITY = np.array([-9.81, 0.0, 0.0])
STILL = Standstill.of(load_robot_file("article").robot, 0.28)


@pytest.fixture(scope="module")
def setup():
    return Setup.of(load_robot_file("article"))


@pytest.fixture(scope="module")
def robot(setup):
    return setup.robot


def test_one_model_serves_all_moduli(robot):
    windows = StillWindows(GRAVITY[None], np.array([[1e-3, np.nan, np.nan, 0.5e-3, np.nan, np.nan]]), np.zeros((1, 3)))
    found = StaticPredictor(robot, windows).predict(
        StaticParameters(np.array([0.6e6, 0.9e6]), np.zeros(6), cable_compliance(robot))
    )
    direct = Simulator(with_moduli(robot, np.array([0.6e6, 0.9e6])), reduced=False).solve(GRAVITY, windows.displacement[0])
    np.testing.assert_allclose(found.tip[0, :3], direct.tip_position, atol=2e-7)
    np.testing.assert_allclose(found.tension[0], direct.cable_tension, atol=1e-4)


def test_derivatives_of_tips_are_those_of_finite_differences(robot):
    windows = StillWindows(GRAVITY[None], np.array([[1.2e-3, np.nan, np.nan, 1.0e-3, np.nan, np.nan]]), np.zeros((1, 3)))
    predictor = StaticPredictor(with_coarse_elements(robot), windows)  # whose slopes are taken
    base = StaticParameters(np.array([0.8e6, 0.8e6]), np.zeros(6), np.full(6, 0.1e-3))
    slopes = predictor.differentiate(base, {"modulus", "radius", "angle", "density", "mount", "bias", "friction"})
    for kind, index, step in (
        ("offset", 0, 2e-6), ("offset", 3, 2e-6), ("compliance", 0, 5e-6), ("compliance", 3, 5e-6), ("modulus", 1, 2e-3),
        ("radius", 3, 2e-3), ("angle", 0, 2e-3), ("density", 0, 2e-3), ("mount", 1, 1e-2), ("bias", 2, 0.1),
        ("friction", 0, 5e-3),
    ):  # fmt: skip
        tips = [predictor.predict(base.changed(kind, (index,), sign * step)).tip[0, :3] for sign in (1, -1)]
        difference = (tips[0] - tips[1]) / (2 * step)
        # The linear answer leaves out how the stiffness changes with tension: a few per cent.
        np.testing.assert_allclose(slopes[kind][0, :3, index], difference, atol=0.08 * np.abs(difference).max(), err_msg=kind)


@pytest.fixture(scope="module")
def windows(setup):
    """Resting tips of a known robot: released in three poses, and with each cable pulled in in the first of them."""
    found = known_windows(known_setup(setup, 0.6e6))
    kept = np.isnan(found.displacement).all(axis=1) | (found.gravity == found.gravity[0]).all(axis=1)
    return StillWindows(found.gravity[kept], found.displacement[kept], found.tip_position[kept], found.tip_direction[kept])


@pytest.mark.slow
def test_a_known_robot_is_recovered_within_two_per_cent(setup, windows):
    fit = fit_statics(setup.robot, windows, groups=GROUPS)
    assert fit.parameters.youngs_modulus == pytest.approx(0.6e6, rel=0.02)
    # The model is softer around a cable's end than the rod; the offsets compensate for that.
    true = offsets(setup.robot)
    assert np.sqrt(np.mean((fit.parameters.offset - true) ** 2)) < 0.5 * np.sqrt(np.mean(true**2))
    assert fit.rms_after < 0.1 * fit.rms_before


def test_exchanged_cables_have_the_tips_of_windows_measured_so(robot, windows):
    coarse, few = (
        with_coarse_elements(robot),
        StillWindows(*(rows[:4] for rows in (windows.gravity, windows.displacement, windows.tip_position))),
    )
    exchanged = few.displacement[:, [1, 0, 2, 3, 4, 5]]
    measured_so = StaticPredictor(coarse, dataclasses.replace(few, displacement=exchanged))
    expected = measured_so.predict(starting_parameters(coarse, ())).tip
    found = StaticPredictor(coarse, few).tips_of(exchanged)
    np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=1e-6)
    assert np.abs(found - StaticPredictor(coarse, few).tips_of(few.displacement)).max() > 1e-3


def test_without_taut_cables_only_the_modulus_is_fitted_with_a_warning(setup, windows):
    released = np.isnan(windows.displacement).all(axis=1)
    windows = StillWindows(
        windows.gravity[released],
        np.full((released.sum(), 6), -0.01),
        windows.tip_position[released],
        windows.tip_direction[released],
    )
    fit = fit_statics(setup.robot, windows, groups=GROUPS)
    assert [e.name for e in fit.estimates] == ["Young's modulus of proximal", "Young's modulus of distal"]
    assert any("no cable is ever taut" in warning for warning in fit.warnings)
    proximal, distal = fit.estimates
    assert proximal.value == pytest.approx(0.6, rel=0.02)
    # Three tips say less of the end, which bends little under its own weight, and the interval says so.
    assert abs(distal.value - 0.6) <= distal.interval < 0.06


def test_an_upright_robot_does_not_show_its_modulus(robot):
    windows = StillWindows(np.array([[0.0, 0.0, 9.81]]), np.full((1, 6), np.nan), np.array([[0.0, 0.0, 0.1]]))
    with pytest.raises(MeasurementError, match="hardly bends"):
        fit_statics(robot, windows)


def course(count: int = 60) -> Measured:
    time = 0.05 * np.arange(count)
    tip = np.array([0.0, 0.0, 0.1]) + 5e-3 * np.outer(np.where(time < 1.0, np.sin(20 * time), 0.0), [1.0, 0.0, 0.0])
    displacement = np.where(np.arange(6) < 3, 1e-3, np.nan) * np.ones((count, 1))
    return Measured(
        "here", np.zeros(count, int), time, np.tile(GRAVITY, (count, 1)), displacement, tip, np.tile([0.0, 0.0, 1.0], (count, 1))
    )


def test_only_the_last_still_window_of_a_stretch_counts():
    windows = still_windows(course(), STILL)
    assert len(windows.tip_position) == 1
    np.testing.assert_allclose(windows.tip_position[0], [0.0, 0.0, 0.1])
    moving = course().rows(slice(0, 20))
    with pytest.raises(MeasurementError, match="never at rest"):
        still_windows(moving, STILL)


def test_csv_is_read_as_it_was_written(tmp_path, robot):
    path = tmp_path / "tips.csv"
    written = dataclasses.replace(course(), specific_force=9.8 + 0.001 * np.arange(60))
    write_csv(written, path, robot.cable_names)
    read = read_measured(path, robot.cable_names)
    for name in ("time", "gravity", "displacement", "tip_position", "tip_direction", "specific_force"):
        np.testing.assert_allclose(getattr(read, name), getattr(written, name), atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("tip_x_mm", "tip_x"), "column 'tip_x_mm' is missing"),
        (lambda text: text.replace("100.0000", "ten", 1), r"line 2: tip_z_mm is 'ten'"),
        (lambda text: text.splitlines()[0], "has 0 samples"),
        (lambda text: text.replace("100.0000", "nan", 1), r"line 2: tip_z_mm is 'nan'; a finite number"),
        (lambda text: text.replace("100.0000", "", 1), r"line 2: tip_z_mm is empty"),
        (lambda text: text.replace("\n0,0.1000,", "\n0,0.0000,", 1), "in trial 0 the time goes from"),
        (lambda text: text[: len(text) - 30], "Is the line cut off"),
        (lambda text: text.replace("100.0000", "100,0000", 1), "commas within numbers"),
        (lambda text: text.replace(",", ";"), "separated by semicolons"),
    ],
)
def test_bad_csv_is_refused_with_what_is_wrong(tmp_path, robot, change, message):
    path = tmp_path / "tips.csv"
    write_csv(course(), path, robot.cable_names)
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(MeasurementError, match=message):
        read_measured(path, robot.cable_names)


def test_calibrated_values_lie_over_the_robot_file(tmp_path, robot):
    source = load_robot_file("article")
    hardware = source.hardware
    parameters = StaticParameters(
        np.array([0.7512e6, 0.81e6]),
        np.array([0.1e-3, 0, 0, 0, 0, -0.2e-3]),
        np.array([0.2e-3] * 3 + [0.0] * 3),
        bias=np.array([0.02, -0.03, 0.01]),
    )
    path = tmp_path / "mine.yaml"
    fitted = calibrated_robot(robot, parameters).with_material(damping_time=0.031)
    imu = calibrated_imu(Setup.of(source).estimator.calibration, robot, parameters)
    write_calibrated(source.source, path, robot, fitted, calibrated_hardware(hardware, parameters), imu=imu)
    mine = load_robot_file(path)
    assert robot.imu_mount.rotation @ Setup.of(mine).estimator.calibration.accel_offset == pytest.approx(
        parameters.bias, abs=2e-5
    )
    motors = mine.hardware.motors
    assert [m.offset for m in motors] == pytest.approx(parameters.offset, abs=1e-9)
    assert [s.material.youngs_modulus for s in mine.robot.segments] == pytest.approx([0.7512e6, 0.81e6])
    assert mine.robot.segments[0].material.damping_time == pytest.approx(0.031)
    assert cable_compliance(mine.robot) == pytest.approx(parameters.compliance, abs=1e-6)
    assert mine.robot.cables[0].axial_stiffness == pytest.approx((0.2 + 0.05) / 0.2e-3)
    assert "base: article" in path.read_text(encoding="utf-8") and mine.robot.limits == robot.limits


def test_robots_of_a_fit_have_one_mesh(robot, monkeypatch):
    """They differ in modulus, damping and creep. Their models are those that each would have by itself."""
    built = []

    class Counted(RobotModel):
        def __init__(self, *given):
            built.append(given)
            super().__init__(*given)

    monkeypatch.setattr(one_mesh, "RobotModel", Counted)
    monkeypatch.setattr(one_mesh, "_last", [])
    coarse = with_coarse_elements(robot)
    braided = with_coarse_elements(robot.with_material(fibres=Fibres(2.0, 0.5)))
    fall = Measured(
        "", np.zeros(3, int), 0.02 * np.arange(3), np.tile(GRAVITY, (3, 1)), np.full((3, 6), np.nan), np.zeros((3, 3))
    )
    for described, count in ((coarse, 1), (braided, 2), (dataclasses.replace(coarse, payload=Payload(0.01)), 3)):
        for changes in ({}, {"youngs_modulus": 0.5e6, "damping_time": 0.03}, {"creep_ratio": 0.2, "creep_time": 0.1}):
            changed = described.with_material(**changes)
            tips = predict_course(changed, fall, DynamicsOptions(0.01))[0]
            assert len(built) == count
            alone = DynamicSimulator(RobotModel(changed), DynamicsOptions(0.01))
            alone.settle(GRAVITY, fall.displacement[0])
            moved = [alone.step(GRAVITY, fall.displacement[0], duration=0.02).tip_position for _ in range(2)]
            np.testing.assert_allclose(tips[1:], moved, rtol=0.0, atol=1e-12)


def test_a_robot_at_rest_is_predicted_to_stay(robot, tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))  # without a reduced model, whose error would be seen
    shape = Simulator(robot, reduced=False).solve(GRAVITY)
    still = Measured(
        "here",
        np.zeros(6, int),
        0.02 * np.arange(6),
        np.tile(GRAVITY, (6, 1)),
        np.full((6, 6), np.nan),
        np.tile(shape.tip_position, (6, 1)),
    )
    tip, direction = predict_course(robot, still)
    np.testing.assert_allclose(tip, still.tip_position, atol=2e-6)
    np.testing.assert_allclose(direction[-1], shape.tip_direction, atol=1e-4)
