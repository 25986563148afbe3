"""The examples run, and what they print is what they promise."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def output_of(name: str) -> str:
    """What the example prints; fails with its error."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(EXAMPLES.parent), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run([sys.executable, str(EXAMPLES / name)], capture_output=True, text=True, timeout=600, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def number(text: str, pattern: str) -> float:
    """The last number that the pattern's group finds."""
    return float(re.findall(pattern, text)[-1])


def test_the_robot_sags_across_gravity_and_not_along_it():
    text = output_of("sagging_robot.py")
    assert number(text, r"horizontal +tip moves by +(\S+) mm") < -20.0
    # By symmetry the hanging robot only gets longer; a hundredth of a millimetre is what is printed.
    assert abs(number(text, r"hanging +tip moves by +(\S+) mm")) <= 0.01


def test_the_compensated_robot_stays_straight_while_gravity_turns():
    text = output_of("compensated_robot.py")
    sag = number(text, r"sags by (\S+) mm")
    assert number(text, r"lateral +(\S+) mm") < 0.01 * sag


def test_gravity_is_found_through_turn_and_bias():
    text = output_of("gravity_from_recording.py")
    # Its accelerometer has no error but noise; the bias of 0.6 deg/s alone, if it stayed, would turn gravity by 1.8 deg in 3 s.
    assert number(text, r"worst error while turning and after: (\S+) deg") < 0.5


def test_an_own_robot_is_read_varied_and_compensated():
    text = output_of("own_robot.py")
    sag = [float(value) for value in re.findall(r"sags +(\S+) mm", text)]
    left = [float(value) for value in re.findall(r"compensated to +(\S+) mm", text)]
    assert len(sag) == 3 and sag[1] < sag[0] < sag[2]
    assert all(abs(after) < 0.05 * before for before, after in zip(sag, left))


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_every_example_is_run(path):
    assert f'output_of("{path.name}")' in Path(__file__).read_text(encoding="utf-8")
