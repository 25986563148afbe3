"""The benchmark of every robot: what it measures, and robots that fail."""

import math

import pytest

from gravcomp.bench import limits, robots
from gravcomp.config import ConfigError

ROBOT = """
robot:
  name: short
  segments:
    - {name: a, length_mm: 40, outer_diameter_mm: 10, lumen_diameter_mm: 4, material: {youngs_modulus_mpa: 2}}
  cables:
    - {name: c, angle_deg: 0, radius_mm: 3.5, segment: a}
  limits: {tension_max: 1}
  elements: {around: 6, along: 4, grading: 4, equal_stiffness: true}
"""


def silent(stage):
    """Progress that nobody looks at."""


@pytest.fixture
def short(tmp_path):
    file = tmp_path / "short.yaml"
    file.write_text(ROBOT)
    return str(file)


def test_mesh_and_rest_of_a_robot_are_measured(short):
    measured = robots.run(silent, files=[short], figures=["mesh_error_pct", "rest_error_pct"])["robots"]["short"]
    assert 0.0 < measured["mesh_error_pct"] < 1.0
    assert measured["rest_error_pct"] < 1e-7
    assert measured["elements"] == [6, 4, 1]


def test_a_robot_that_fails_is_reported_and_the_others_go_on(short, tmp_path):
    broken = tmp_path / "broken.yaml"
    broken.write_text(ROBOT.replace("short", "wedges").replace("lumen_diameter_mm: 4", "lumen_diameter_mm: 0.5"))
    measured = robots.run(silent, files=[str(broken), "nowhere.yaml", short], figures=["rest_error_pct"])
    assert list(measured["robots"]) == ["wedges", "nowhere", "short"]
    assert "Jacobian" in measured["robots"]["wedges"]["errors"]["rest_error_pct"]
    assert measured["robots"]["short"]["rest_error_pct"] < 1e-7
    assert "does not exist" in measured["robots"]["nowhere"]["errors"]["file"]
    figures = limits.figures("robots", {"robots": {"x": {"rest_error_pct": None}, "y": {"rest_error_pct": 1e-9}}})
    assert [figure.reached for figure in figures] == [False, True] and math.isnan(figures[0].value)


def test_what_was_measured_is_kept_until_the_robot_changes(short, tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    count = iter(range(10))
    monkeypatch.setattr(robots.robot_figures, "measure", lambda name, file, every: {name: next(count)})

    def found(file, **options):
        return robots.run(silent, files=[file], figures=["build_s"], **options)["robots"]["short"]["build_s"]

    assert [found(short), found(short), found(short, every=2), found(short, again=True), found(short)] == [0, 0, 1, 2, 2]
    stiffer = tmp_path / "stiffer.yaml"
    stiffer.write_text(ROBOT.replace("youngs_modulus_mpa: 2", "youngs_modulus_mpa: 3"))
    assert found(str(stiffer)) == 3


def test_a_figure_that_does_not_exist_is_refused():
    with pytest.raises(ConfigError, match="allowed: mesh_error_pct"):
        robots.run(silent, figures=["speed"])


def test_missing_data_make_a_figure_null(monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("GRAVCOMP_DATA", str(tmp_path / "data"))
    assert robots.run(silent, figures=["tdcr_mm"]) == {"robots": {}, "tdcr_mm": None}
    assert "tdcr" in caplog.text
