"""`gravcomp reproduce`: what cannot be run is named, never a traceback."""

import json

import pytest

from gravcomp.closed_loop.loop_failed import LoopFailed
from gravcomp.commands.__main__ import main
from gravcomp.commands.reproduce import _unless_left_out
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file
from gravcomp.experiments import real2sim
from gravcomp.report.result import Figure, Result


def test_an_experiment_whose_motors_cannot_drive_the_robot_says_so(capsys):
    class Experiment:
        @staticmethod
        def run(subject):
            raise LoopFailed("the bridge refused a command at 0.93 s: not following commands")

    with pytest.raises(ConfigError, match="refused a command"):
        _unless_left_out(lambda name: Experiment, "static", None, False)
    assert _unless_left_out(lambda name: Experiment, "static", None, True) is None
    assert "static: the bridge refused" in capsys.readouterr().err


def test_one_experiment_is_run_by_its_other_name(tmp_path, monkeypatch, capsys):
    """`reproduce all --brief` runs every experiment as it is (`test_documented_experiments`)."""
    asked = []

    def run(context) -> Result:
        asked.append((context.brief, context.setup.robot.name, context.setup.seed))
        figures = [Figure("worst", 1.0, "mm", limit=2.0)]
        return Result("real2sim", real2sim.TITLE, question="", ground="", figures=figures, parts=[], parameters={}, notes=[])

    monkeypatch.setattr(real2sim, "run", run)
    monkeypatch.setattr("gravcomp.commands.model.build.prepare_model", lambda robot: None)
    assert main(["reproduce", "freefall", "--brief", "--seed", "3", "--out", str(tmp_path), "--json"]) == 0
    assert asked == [(True, load_robot_file("article").robot.name, 3)]
    (found,) = json.loads(capsys.readouterr().out)["experiments"]
    assert found["title"] == "Real to simulation: free fall"
    assert "Run with --brief" in (tmp_path / "real2sim.html").read_text(encoding="utf-8")
    assert not (tmp_path / "index.html").exists()
