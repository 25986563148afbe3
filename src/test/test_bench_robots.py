"""The benchmark of every robot: what it measures, and robots that fail."""

import math

import pytest

from gravcomp.bench import limits, robot_parts, robots
from gravcomp.config import ConfigError
from gravcomp.sweep import Sweep

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
    file.write_text(ROBOT, encoding="utf-8")
    return str(file)


def test_mesh_and_rest_of_a_robot_are_measured(short):
    found = robots.run(silent, files=[short], mesh=True)
    measured = found["robots"]["short"]
    assert list(found) == ["robots"] and list(measured) == ["mesh_error_pct", "rest_error_pct", "elements"]
    assert 0.0 < measured["mesh_error_pct"] < 1.0
    assert measured["rest_error_pct"] < 1e-7
    assert measured["elements"] == [6, 4, 1]


@pytest.mark.parametrize(
    ("options", "words"), [({"loop": True}, "exclude each other"), ({"figures": ["build_s"]}, "has 'build_s'")]
)
def test_the_mesh_alone_has_no_other_figures(options, words):
    with pytest.raises(ConfigError, match=words):
        robots.run(silent, mesh=True, **options)


def test_a_robot_that_fails_is_reported_and_the_others_go_on(short, tmp_path):
    broken = tmp_path / "broken.yaml"
    broken.write_text(
        ROBOT.replace("short", "wedges").replace("lumen_diameter_mm: 4", "lumen_diameter_mm: 0.5"), encoding="utf-8"
    )
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
    monkeypatch.setattr(robots.robot_figures, "measure", lambda name, file, every, progress: {name: next(count)})

    def found(file, **options):
        return robots.run(silent, files=[file], figures=["build_s"], **options)["robots"]["short"]["build_s"]

    assert [found(short), found(short), found(short, every=2), found(short, again=True), found(short)] == [0, 0, 1, 2, 2]
    stiffer = tmp_path / "stiffer.yaml"
    stiffer.write_text(ROBOT.replace("youngs_modulus_mpa: 2", "youngs_modulus_mpa: 3"), encoding="utf-8")
    assert found(str(stiffer)) == 3


def test_a_figure_that_does_not_exist_is_refused():
    with pytest.raises(ConfigError, match="allowed: build_s, mesh_error_pct"):
        robots.run(silent, figures=["speed"])


def test_missing_data_make_a_figure_null(monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("GRAVCOMP_DATA", str(tmp_path / "data"))
    assert robots.run(silent, figures=["tdcr_mm"]) == {"robots": {}, "tdcr_mm": None}
    assert "tdcr" in caplog.text


@pytest.fixture
def fake_parts(monkeypatch, tmp_path):
    """Parts that take no time; returns the list of those that ran."""
    ran = []

    def loop(file, part):
        ran.append(part)
        run = {
            "held": 0.02 * part.seed,
            "moving": 0.03,
            "held_m": 2e-4 * part.seed,
            "moving_m": 3e-4,
            "sag": 1e-2,
            "settled": 0.5,
        }
        return run | ({"settled": None} if part.seed == 2 else {})

    def calibration(file, part):
        ran.append(part)
        return {"held": 1.5, "moving": part.seed + 1.0, "modulus": 0.5, "compliance": None, "seconds": 170.0}

    def broken(file, part):
        ran.append(part)
        raise RuntimeError("the bridge does not start")

    kinds = {
        "loop": loop,
        "calibration": calibration,
        "similarity": lambda file, part: {"difference": 0.01},
        "holdability": broken,
    }
    monkeypatch.setattr(robot_parts, "KINDS", kinds)
    monkeypatch.setattr("gravcomp.bench.robot_loop.Sweep", lambda: Sweep(1))
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))
    return ran


def test_the_loop_has_the_worst_seed_and_goes_on_where_it_was(short, fake_parts):
    first = robots.run(silent, files=[short], loop=True)["robots"]["short"]
    assert first["uncalibrated_pct"] == 6.0 and first["calibrated_pct"] == 1.5 and first["similarity_pct"] == 1.0
    assert first["moving_pct"] == 4.0 and first["uncalibrated_moving_pct"] == 3.0  # the limit is that of the calibrated model
    assert first["settle_s"] is None and first["compliance_error_pct"] is None
    assert first["unholdable"] is None and "bridge does not start" in first["errors"]["short: holdability, seed 1"]
    assert len(fake_parts) == 3 + 3 + 1
    again = robots.run(silent, files=[short], loop=True)["robots"]["short"]
    assert again == first and len(fake_parts) == 3 + 3 + 1 + 1  # only what failed
    with open(short, "a", encoding="utf-8") as file:
        file.write("virtual_robot: {body: {damping_time_ms: 20}}\n")
    robots.run(silent, files=[short], loop=True, figures=["uncalibrated_pct"])
    assert len(fake_parts) == 3 + 3 + 1 + 1 + 3


def test_what_cannot_be_told_is_no_missed_figure():
    measured = {"robots": {"x": {"compliance_error_pct": None, "calibrated_pct": None}, "y": {"compliance_error_pct": 3.0}}}
    assert {figure.name[:1]: figure.reached for figure in limits.figures("robots", measured)} == {"x": False, "y": True}
    measured["robots"]["x"]["errors"] = {"loop": "no"}
    assert [figure.reached for figure in limits.figures("robots", measured)] == [False, False, True]


def test_figures_of_the_loop_that_do_not_exist_are_refused():
    with pytest.raises(ConfigError, match="allowed with --loop: uncalibrated_pct"):
        robots.run(silent, figures=["build_s"], loop=True)
