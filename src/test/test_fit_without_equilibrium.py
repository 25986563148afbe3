"""Fits whose trial points have no equilibrium: they go on with a shorter step; only a start without one is an error."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from test_calibration_intervals import GROUPS, TRUE_RATIO, Springs, measured_springs

from gravcomp.calibration import motion
from gravcomp.calibration.fit import fit_statics
from gravcomp.calibration.measured import Measured, MeasurementError, StillWindows
from gravcomp.calibration.parameters import starting_parameters
from gravcomp.calibration.pose_fit import MODULUS, fit_poses
from gravcomp.calibration.pose_prediction import PosePredictor
from gravcomp.calibration.poses import Poses
from gravcomp.calibration.problem import Problem
from gravcomp.calibration.report import calibration_result
from gravcomp.calibration.statics import StaticPredictor
from gravcomp.calibration.unknowns import Priors, prior_rows, unknowns_of
from gravcomp.description import Cable, Elements, Material, Robot, Segment, load_robot_file
from gravcomp.mesh.coarse import with_coarse_elements

LOST = "no equilibrium here"


@pytest.fixture(scope="module")
def robot():
    return load_robot_file("article").robot


def springs_that(robot, *, predict=lambda ratio: True, differentiate=lambda ratio: True) -> Springs:
    """Springs that have an equilibrium, or derivatives, only where these say so of the ratio (s,) of the moduli to the start."""
    springs = measured_springs(robot, 0, 1e-4)
    described = np.array([material.youngs_modulus for material in robot.materials])

    def guarded(function, allowed):
        def call(parameters, *others):
            if not allowed(parameters.youngs_modulus / described):
                raise RuntimeError(LOST)
            return function(parameters, *others)

        return call

    springs.predict = guarded(springs.predict, predict)
    springs.differentiate = guarded(springs.differentiate, differentiate)
    return springs


def ratio_of(fit, robot) -> np.ndarray:
    return fit.parameters.youngs_modulus / np.array([material.youngs_modulus for material in robot.materials])


def test_a_static_fit_goes_on_with_older_derivatives_where_there_are_no_others(robot):
    springs = springs_that(robot, differentiate=lambda ratio: np.abs(np.log(ratio)).max() < 1e-3)
    fit = fit_statics(robot, springs.windows, groups=GROUPS, predictor=springs)
    assert ratio_of(fit, robot) == pytest.approx(TRUE_RATIO, rel=0.01)


def test_a_search_begins_nearer_to_the_described_robot_where_its_start_has_no_equilibrium(robot):
    springs = springs_that(robot, predict=lambda ratio: np.abs(np.log(ratio)).max() < 0.3)
    initial = starting_parameters(robot, ())
    unknowns = unknowns_of(robot, springs.predict(initial), initial, GROUPS, Priors())
    sigma = np.array([1e-4 * robot.length, 1e-3])
    problem = Problem(springs, initial, unknowns, prior_rows(unknowns, Priors()), sigma, lambda sentence: None)
    start = np.array([0.5 if unknown.kind == "modulus" else 0.0 for unknown in unknowns])
    x = problem.solve(start, np.ones(len(unknowns), dtype=bool))
    assert np.exp(x[:2]) == pytest.approx(TRUE_RATIO, rel=0.01)


@pytest.mark.parametrize("part", ["predict", "differentiate"])
def test_a_described_robot_without_equilibrium_is_an_error_with_a_sentence(robot, part):
    springs = springs_that(robot, **{part: lambda ratio: False})
    with pytest.raises(MeasurementError, match=f"the described robot has no shape: {LOST}; check gravity"):
        fit_statics(robot, springs.windows, groups=GROUPS, predictor=springs)


MATERIAL = Material("neo_hookean", 0.5e6, 0.45, density=1100.0, damping_time=0.01)
ELEMENTS = Elements(around=4, along=6, grading=1.0, equal_stiffness=True)
BAR = Robot(
    "bar",
    segments=(Segment("a", 0.1, 12e-3, material=MATERIAL),),
    cables=(Cable("c", 0.0, 3e-3, segment="a"),),
    elements=ELEMENTS,
)
GRAVITY = np.array([-9.81, 0.0, 0.0])


def test_derivatives_come_from_the_other_side_where_a_step_has_no_equilibrium(monkeypatch):
    windows = StillWindows(GRAVITY[None], np.array([[1.5e-3]]), np.zeros((1, 3)))
    parameters = starting_parameters(BAR, ())
    kinds = {"radius", "angle", "friction"}
    bar = with_coarse_elements(BAR)  # whose slopes are taken
    there = StaticPredictor(bar, windows).differentiate(parameters, kinds)
    predictor = StaticPredictor(bar, windows)
    apply, place = predictor._apply, predictor._set_tendons

    def no_friction(changed):
        if changed.friction > 0.0:
            raise RuntimeError(LOST)
        apply(changed)

    def not_outwards(changed, places):
        if (places > 0.0).any():
            raise RuntimeError(LOST)
        place(changed, places)

    monkeypatch.setattr(predictor, "_apply", no_friction)
    monkeypatch.setattr(predictor, "_set_tendons", not_outwards)
    found = predictor.differentiate(parameters, kinds)
    for kind in kinds:
        np.testing.assert_allclose(found[kind], there[kind], atol=0.1 * np.abs(there[kind]).max() + 1e-9, err_msg=kind)


def test_a_fine_mesh_has_derivatives_of_its_own_where_the_coarse_one_has_no_equilibrium(monkeypatch):
    def lost(*arguments):
        raise RuntimeError(LOST)

    windows = StillWindows(GRAVITY[None], np.array([[np.nan]]), np.zeros((1, 3)))
    coarse, own = StaticPredictor(with_coarse_elements(BAR), windows), StaticPredictor(BAR, windows)
    slopes = coarse.differentiate(starting_parameters(BAR, ()), {"modulus"})["modulus"]
    monkeypatch.setattr(coarse, "differentiate", lost)
    monkeypatch.setattr(own, "_coarse", coarse)
    found = own.differentiate(starting_parameters(BAR, ()), {"modulus"})["modulus"]
    np.testing.assert_allclose(found, slopes, atol=0.2 * np.abs(slopes).max())


def test_a_cable_that_would_leave_the_body_is_a_refused_step():
    predictor = StaticPredictor(BAR, StillWindows(GRAVITY[None], np.array([[1.5e-3]]), np.zeros((1, 3))))
    with pytest.raises(RuntimeError, match=r"runs 7\.5 mm from the axis"):
        predictor.predict(starting_parameters(BAR, ()).changed("radius", (0,), 1.5))


def swing(robot: Robot, course: Measured, steps: object = None) -> tuple[np.ndarray, np.ndarray]:
    """Course of a tip on a spring and a damper, in place of the model's; like a swing of the bar with its values."""
    material, (x, z) = robot.materials[0], (0.02, 0.1)
    rate, decay = 40.0 * np.sqrt(material.youngs_modulus / 0.5e6), 500.0 * material.damping_time
    tip = x * 0.5e6 / material.youngs_modulus * (np.exp(-decay * course.time) * np.cos(rate * course.time) - 1.0)
    return np.column_stack([tip, np.zeros_like(tip), np.full_like(tip, z)]), np.tile([0.0, 0.0, 1.0], (len(tip), 1))


@pytest.fixture
def fall() -> Measured:
    """The swing of a softer bar, as it would be measured."""
    time = np.linspace(0.0, 0.3, 61)
    gravity, displacement = np.tile(GRAVITY, (61, 1)), np.full((61, 1), np.nan)
    measured = Measured("fall", np.zeros(61, int), time, gravity, displacement, np.zeros((61, 3)), None)
    return dataclasses.replace(measured, tip_position=swing(BAR.with_material(youngs_modulus=0.4e6), measured)[0])


def test_a_motion_that_cannot_be_computed_is_a_refused_step(monkeypatch, fall):
    refused = []

    def predicted(robot, *others):
        if not 0.39e6 < robot.materials[0].youngs_modulus < 0.501e6:
            refused.append(robot)
            raise RuntimeError(LOST)
        return swing(robot, *others)

    monkeypatch.setattr(motion, "predict_course", predicted)
    fit = motion.fit_motion(BAR, [fall], creep=False)
    assert refused and fit.youngs_modulus == pytest.approx(0.4e6, rel=0.01)
    with pytest.raises(RuntimeError, match="fall: the motion of the robot as it is described cannot be computed"):
        motion.fit_motion(BAR.with_material(youngs_modulus=1e6), [fall], creep=False)


def test_a_fit_of_a_motion_ends_with_the_evaluations_that_it_may_take(monkeypatch, fall):
    """As those of a brief run do; the values have moved towards the true ones."""
    monkeypatch.setattr(motion, "predict_course", swing)
    whole, brief = (motion.fit_motion(BAR, [fall], creep=False, evaluations=most) for most in (motion.EVALUATIONS, 2))
    assert brief.evaluations < whole.evaluations
    assert whole.rms_after < brief.rms_after < brief.rms_before


def test_the_error_of_a_described_robot_whose_motion_cannot_be_computed_is_unknown(monkeypatch, fall):
    """The report says so in words, without a number."""

    def predicted(robot, course, *others):
        if robot == BAR and len(course.time) == len(fall.time):
            raise RuntimeError(LOST)
        return swing(robot, course, *others)

    monkeypatch.setattr(motion, "predict_course", predicted)
    fit = motion.fit_motion(BAR, [fall], creep=False)
    assert fit.rms_before is None and fit.rms_after < 1e-4
    tips = SimpleNamespace(tip=np.zeros((1, 6)))
    statics = SimpleNamespace(
        estimates=[], fitted=(), warnings=[], rms_before=1e-3, rms_after=1e-4, open_error=1e-5, sag=None, evaluations=1,
        before=tips, after=tips,
        windows=StillWindows(GRAVITY[None], np.full((1, 1), np.nan), np.zeros((1, 3))),
    )  # fmt: skip
    result = calibration_result("fall", "fitted.yaml", statics, fit, [fall], 0.01)
    assert all(np.isfinite(figure.value) for figure in result.figures)
    assert any("the motion of the robot as it is described cannot be computed" in note for note in result.notes)


def test_poses_are_fitted_from_the_described_robot_where_another_start_has_no_equilibrium(monkeypatch):
    at = np.array([[0.0, 0.0, 0.1]])
    poses = Poses("known", ("a",), GRAVITY[None], np.array([[1.0]]), None, ((),), ("1",), at, np.zeros((1, 1, 3)))
    parameters = dataclasses.replace(PosePredictor(BAR, poses).initial(), youngs_modulus=0.45e6)
    poses = dataclasses.replace(poses, measured=PosePredictor(BAR, poses).predict(parameters))
    predict = PosePredictor.predict

    def stiff(predictor, parameters):
        return predict(predictor, parameters) if parameters.youngs_modulus > 0.4e6 else np.full_like(poses.measured, np.nan)

    monkeypatch.setattr(PosePredictor, "predict", stiff)
    fit = fit_poses(BAR, poses, (MODULUS,), start=np.array([-1.0]))
    assert fit.parameters.youngs_modulus == pytest.approx(0.45e6, rel=0.01)
