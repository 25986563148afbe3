"""`gravcomp reproduce`: what cannot be run is named, never a traceback."""

import pytest

from gravcomp.closed_loop.loop_failed import LoopFailed
from gravcomp.commands.reproduce import _unless_left_out
from gravcomp.config import ConfigError


def test_an_experiment_whose_motors_cannot_drive_the_robot_says_so(capsys):
    class Experiment:
        @staticmethod
        def run(subject):
            raise LoopFailed("the bridge refused a command at 0.93 s: not following commands")

    with pytest.raises(ConfigError, match="refused a command"):
        _unless_left_out(lambda name: Experiment, "static", None, False)
    assert _unless_left_out(lambda name: Experiment, "static", None, True) is None
    assert "static: the bridge refused" in capsys.readouterr().err
