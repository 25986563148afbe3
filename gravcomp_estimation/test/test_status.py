"""The status states the most severe problem in one sentence."""

from dataclasses import replace

import pytest

pytest.importorskip("gravcomp_msgs.msg", reason="the workspace is not built or not sourced")

from gravcomp_estimation.status import Situation, evaluate

from gravcomp.orientation import GravityEstimator, Problem
from gravcomp.thermal import HeaterFault, HeaterState
from gravcomp_msgs.msg import ImuStatus

HEATER = HeaterState(duty=0.3, target=35.0, temperature=35.0, ready=True, fault=HeaterFault.NONE)


@pytest.fixture
def situation():
    estimator = GravityEstimator()
    for k in range(300):
        estimate = estimator.update(k * 10_000_000, (1e-4 * (k % 3), 0, 0), (0, 1e-3 * (k % 5), 9.81))
    return Situation(0.01, Problem.NONE, None, estimate, HEATER, 0.5)


def test_without_a_problem_the_status_is_ok(situation):
    assert evaluate(situation) == (ImuStatus.OK, "at rest")


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"sample_age": None}, ImuStatus.NO_DATA, "yet"),
        ({"sample_age": 2.0}, ImuStatus.NO_DATA, "for 2.0 s"),
        ({"problem": Problem.NOT_FINITE, "problem_age": 0.1}, ImuStatus.BAD_DATA, "NaN"),
        ({"heater": replace(HEATER, fault=HeaterFault.DEAD_HEATER)}, ImuStatus.HEATER_FAULT, "heater off"),
        ({"estimate": None}, ImuStatus.INITIALISING, "not converged"),
    ],
)
def test_each_problem_has_its_code(situation, change, code, words):
    found, sentence = evaluate(replace(situation, **change))
    assert found == code and words in sentence


def test_no_data_precedes_a_heater_fault(situation):
    worse = replace(situation, sample_age=3.0, heater=replace(HEATER, fault=HeaterFault.DEAD_SENSOR))
    assert evaluate(worse)[0] == ImuStatus.NO_DATA


def test_an_accelerometer_with_a_large_error_is_uncalibrated(situation):
    off = replace(situation.estimate, calibrated=False)
    code, sentence = evaluate(replace(situation, estimate=off))
    assert code == ImuStatus.UNCALIBRATED and "calibrate" in sentence
