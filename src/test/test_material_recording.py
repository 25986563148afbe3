"""Prony series from relaxation and creep tests: closed forms, recovered terms, intervals, the robot file, refused tables."""

import json

import numpy as np
import pytest

from gravcomp.calibration.material_recording import MaterialTest, read_material_recording
from gravcomp.calibration.measured import MeasurementError
from gravcomp.calibration.prony_fit import course, fit_series
from gravcomp.commands.__main__ import main
from gravcomp.description import load_robot_file

SHARE, TIME = np.array([0.1, 0.2]), np.array([0.5, 8.0])
RATIO = SHARE / (1.0 - SHARE.sum())


def recorded(seed, creep=False, noise=2e-3, end=120.0, scale=3.3):
    """A test sampled at 20 Hz."""
    time = np.arange(0.05, end, 0.05)
    wrong = 1.0 + noise * np.random.default_rng(seed).standard_normal(len(time))
    return MaterialTest("here", "strain" if creep else "stress", time, scale * course(RATIO, TIME, time, creep) * wrong, creep)


def test_one_branch_creeps_by_its_closed_form():
    """J(t) = J_inf (1 - rho / (1 + rho) exp(-t / (T (1 + rho))))."""
    time, rho, relaxation = np.linspace(0.0, 20.0, 40), 0.3, 3.0
    closed = 1.0 - rho / (1.0 + rho) * np.exp(-time / (relaxation * (1.0 + rho)))
    assert course(np.array([rho]), np.array([relaxation]), time, creep=True) == pytest.approx(closed, abs=1e-13)


def test_creep_and_relaxation_of_a_series_are_inverse_to_each_other():
    """The convolution of the relaxation with the rate of the creep is one."""
    time = np.linspace(0.0, 30.0, 6001)
    creep, relaxation = (course(RATIO, TIME, time, what) for what in (True, False))
    middle = 0.5 * (relaxation[1:] + relaxation[:-1])
    stress = creep[0] * relaxation[-1] + np.diff(creep) @ middle[::-1]
    assert stress == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("creep", [False, True])
def test_the_terms_are_found_and_their_intervals_contain_the_truth(creep):
    inside = []
    for seed in range(4):
        fit = fit_series(recorded(seed, creep))
        assert len(fit.terms) == 2 and not fit.notes
        assert [term.share for term in fit.prony] == pytest.approx(SHARE, rel=0.05)
        assert [term.time for term in fit.prony] == pytest.approx(TIME, rel=0.1)
        inside += [abs(found.term.share - share) <= found.share_interval for found, share in zip(fit.terms, SHARE)]
        inside += [found.time_limits[0] <= time <= found.time_limits[1] for found, time in zip(fit.terms, TIME)]
    assert np.mean(inside) >= 0.75


def test_what_a_short_recording_does_not_show_is_said():
    fit = fit_series(recorded(1, end=6.0))
    assert any("too short" in note for note in fit.notes)
    elastic = MaterialTest("here", "stress", np.linspace(0.1, 10.0, 200), 1.0 + 1e-3 * np.cos(np.arange(200.0) ** 2), creep=False)
    with pytest.raises(MeasurementError, match="no relaxation beyond its noise"):
        fit_series(elastic)


def test_the_command_writes_the_series_into_a_robot_file(tmp_path, capsys):
    test = recorded(3)
    table = tmp_path / "held.csv"
    np.savetxt(table, np.column_stack([test.time / 60.0, -test.value]), delimiter=",", header="time_min,force_n", comments="")
    written = tmp_path / "soft.yaml"
    arguments = ["calibrate", str(table), "--material", "--robot", "article", "--write", str(written), "--out", str(tmp_path)]
    assert main([*arguments, "--json", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [term["time_s"] for term in found["data"]["prony"]] == pytest.approx(TIME, rel=0.1)
    for material in load_robot_file(str(written)).robot.materials:
        assert [term.share for term in material.prony] == pytest.approx(SHARE, rel=0.05)
    assert (tmp_path / "calibration.html").exists()


ROWS = "\n".join(f"{k},{1.0 + 1.0 / k}" for k in range(1, 20))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("second,stress_kpa\n" + ROWS, "no column with the time: second, stress_kpa"),
        ("time_s,tension\n" + ROWS, "no column with the course"),
        ("time_s,stress_kpa,strain\n1,2,3", "several columns with the course: stress_kpa, strain"),
        ("time_s,stress_kpa\n1,2\n2,", "line 3: stress_kpa is empty"),
        ("time_s,stress_kpa\n1,2\n2,high", "line 3: stress_kpa is 'high'"),
        ("time_s,stress_kpa\n1,2\n1,3", "line 3: time_s does not increase"),
        ("time_s,stress_kpa\n1,2\n2,3", "has 2 samples after the time 0, from 1 to 2 s; at least 8"),
        ("time_s,strain_pct\n" + ROWS.replace("10,1.1", "10,-1.1"), "line 11: strain_pct is zero or changes its sign"),
    ],
)
def test_tables_that_are_no_test_are_refused(tmp_path, text, found):
    table = tmp_path / "test.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(MeasurementError, match=found):
        read_material_recording(table)
