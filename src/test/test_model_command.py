"""`gravcomp model`: what its subcommands print and write."""

import json

import pytest

from gravcomp.commands.__main__ import main


def test_solve_prints_the_shape(capsys):
    load = ["--gravity", "0", "0", "-9.81", "--tension", "0.1", "0", "0", "0", "0", "0"]
    assert main(["model", "solve", "article", *load, "--full", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["model"] == "full" and figures["tip_position_mm"][0] > 1.0
    assert len(figures["backbone_position_mm"]) == 11 and figures["tension_n"][0] == pytest.approx(0.1)
    assert figures["residual_n"] < 1e-6


def test_solve_reaches_a_target(capsys):
    arguments = ["--gravity", "-9.81", "0", "0", "--target", "0", "0", "99", "--full", "--json"]
    assert main(["model", "solve", *arguments]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert abs(figures["tip_position_mm"][0]) < 0.3


def test_view_writes_a_picture(tmp_path, capsys):
    assert main(["model", "view", "--full", "--out", str(tmp_path / "robot.png")]) == 0
    assert (tmp_path / "robot.png").stat().st_size > 10_000


def test_info_tells_masses_modes_and_reach(capsys):
    assert main(["model", "info", "mesh_body", "--directions", "4", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["mass_g"] == pytest.approx(3.44, abs=0.05) and figures["mesh"]["kind"] == "tet10"
    assert len(figures["natural_frequency_hz"]) == 6 and len(figures["reach"]) == 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["solve", "nowhere"], "does not exist"),
        (["solve", "--tension", "1"], "(6,) is needed"),
        (["solve", "--direction", "0", "0", "1"], "--target"),
    ],
)
def test_mistakes_are_named(arguments, words, capsys):
    assert main(["model", *arguments]) == 2
    assert words in capsys.readouterr().err
