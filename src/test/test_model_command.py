"""`gravcomp model`: what its subcommands print and write."""

import json
import math

import pytest

from gravcomp.commands.__main__ import main
from gravcomp.commands.model.reach import reach
from gravcomp.description import Cable, Elements, Limits, Material, RestShape, Robot, Segment
from gravcomp.simulation import Simulator

pytestmark = pytest.mark.slow


def test_solve_prints_the_shape(capsys):
    load = ["--gravity", "0", "0", "-9.81", "--tension", "0.1", "0", "0", "0", "0", "0"]
    assert main(["model", "solve", "article", *load, "--full", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["model"] == "full" and figures["tip_position_mm"][0] > 1.0
    assert len(figures["backbone_position_mm"]) == 11 and figures["tension_n"][0] == pytest.approx(0.1)
    assert figures["residual_n"] < 1e-6


def test_solve_reaches_a_target(tmp_path, capsys):
    coarse = tmp_path / "coarse.yaml"
    coarse.write_text("base: article\nrobot:\n  elements: {around: 4, along: 4}\n", encoding="utf-8")
    arguments = [str(coarse), "--gravity", "-9.81", "0", "0", "--target", "0", "0", "99", "--full", "--json"]
    assert main(["model", "solve", *arguments]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert abs(figures["tip_position_mm"][0]) < 0.3


def test_view_writes_a_picture(tmp_path, capsys):
    assert main(["model", "view", "--full", "--out", str(tmp_path / "robot.png")]) == 0
    assert (tmp_path / "robot.png").stat().st_size > 10_000


def test_info_tells_masses_modes_and_reach(tmp_path, capsys):
    weak = tmp_path / "weak.yaml"  # far from the bends at which its equilibria take many steps
    weak.write_text("base: mesh_body\nrobot:\n  limits: {tension_max: 0.3}\n", encoding="utf-8")
    assert main(["model", "info", str(weak), "--directions", "4", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["mass_g"] == pytest.approx(3.44, abs=0.05) and figures["mesh"]["kind"] == "hex20"
    assert len(figures["natural_frequency_hz"]) == 6
    assert [(entry["cable"], entry["ended_by"]) for entry in figures["reach"]] == [(f"c{k}", "tension limit") for k in (1, 2, 3)]


@pytest.mark.parametrize("command", [["info", "--no-hold"], ["solve"], ["view", "--out", "robot.png"], ["build"]])
def test_a_mesh_that_has_to_be_chosen_is_announced(command, monkeypatch, tmp_path, capsys):
    """Without a terminal, where no status is shown; the choice takes up to 41 s."""
    from gravcomp.full_model import chosen_elements

    def choice(robot):
        assert "choosing the mesh of rod" in capsys.readouterr().err
        raise ValueError("no choice in a test")

    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    monkeypatch.setattr(chosen_elements, "chosen_mesh", choice)
    rod = tmp_path / "rod.yaml"
    rod.write_text("robot:\n  name: rod\n  segments: [{name: a, length_mm: 150, outer_diameter_mm: 10}]\n", encoding="utf-8")
    assert main(["model", command[0], str(rod), *command[1:]]) == 2
    assert "no choice in a test" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["solve", "nowhere"], "does not exist"),
        (["solve", "--tension", "1"], "--tension has 1 numbers; one for each cable is needed: s1c1"),
        (["solve", "--direction", "0", "0", "1"], "--target"),
    ],
)
def test_mistakes_are_named(arguments, words, capsys):
    assert main(["model", *arguments]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(("angle", "ended_by"), [(0.0, "half turn"), (180.0, "tension limit")])
def test_the_reach_of_a_robot_that_is_bent_at_rest_counts_from_its_rest(angle, ended_by):
    """The cable outside its bend straightens it first: its tip turns from the rest, although it comes nearer to the axis."""
    rest = RestShape(bend_angle=math.radians(70.0))
    segment = Segment("s", 0.06, 7e-3, 3e-3, material=Material("neo_hookean", 2e6, 0.45), rest=rest)
    robot = Robot(
        "hook",
        segments=(segment,),
        cables=(Cable("c", math.radians(angle), 2.5e-3, segment="s"),),
        elements=Elements(around=4, along=6),
        limits=Limits(tension_max=8.0 if angle == 0.0 else 1.5),
    )
    (entry,) = reach(Simulator(robot, reduced=False))
    assert entry["ended_by"] == ended_by
    # E I is 2.3e-4 N m^2: a tension of 1.5 N bends it by 1 rad or so.
    assert entry["tilt_deg"] > (130.0 if angle == 0.0 else 40.0) and entry["lateral_mm"] > (5.0 if angle == 0.0 else 25.0)
