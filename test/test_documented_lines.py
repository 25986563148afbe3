"""Every line in a code block of the documents is run: as it is, or with options of the test that make it shorter.

A value replaces each placeholder (FILE, ROBOT.yaml), and what a line writes goes into a folder of the test. Lines for a CAN
device must give the error of a machine without one; lines that start other programmes are not run.

This file runs lines that need no running graph. The other files `test_documented_*` run the others.
"""

import os
import re
from pathlib import Path

import pytest
from documents import TYPED, documented

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

from ros2_line import run_node

from gravcomp.commands.check import CHECKS

pytestmark = pytest.mark.timeout(900)

# Not installed by this project.
FOREIGN = ("ros2 launch foxglove_bridge", "ros2 launch gravcomp_fem", "ros2 run plotjuggler", "ros2 run robot_state_publisher")
RECORDED = Path(__file__).parent / "data" / "imu_and_gravity"


def test_every_line_is_run_by_a_test():
    """A new line of a document fails here until a test runs it."""
    sources = "".join(path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_*.py"))
    run = set(re.findall(r"""["']((?:\./gravcomp|ros2) [^"\n]*?)["'](?=[,)\]\s])""", sources))
    missing = [line for line in TYPED if line not in run and not line.startswith(FOREIGN)]
    assert not missing, "\n".join(missing)


MODEL_LINES = (
    "./gravcomp model info article",
    "./gravcomp model solve article --gravity -9.81 0 0",
    "./gravcomp model solve article --gravity -9.81 0 0 --target 0 0 100",
    "./gravcomp model solve article --full --wrench 0 0.02 0",
    "./gravcomp model solve article --full --wrench 0 0 -0.05 0 0.0005 0 --wrench-at 0.5 --wrench-frame follower",
    "./gravcomp model view article --tension 0 0 0 0.3 0 0 --out bent.png",
    "./gravcomp model info src/examples/own_robot.yaml --picture sphere.png",
    "./gravcomp model build src/examples/own_robot.yaml",
    "./gravcomp model view ROBOT --rest --out body.png",
)


@pytest.mark.parametrize("line", MODEL_LINES)
def test_a_model_is_described_solved_drawn_and_built(type_in, folder, line):
    documented("./gravcomp model info src/examples/own_robot.yaml")  # run with its picture
    code, output = type_in(line, "--directions 4" if "info" in line else "", ROBOT="ROBOT.yaml")
    assert code == 0, output
    for picture in re.findall(r"\w+\.png", line):
        assert (folder / picture).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("line", ["./gravcomp doctor", "./gravcomp doctor --robot src/examples/own_robot.yaml"])
def test_the_doctor_examines_the_machine(type_in, line):
    code, output = type_in(line)
    # 1: this machine lacks something that is needed; that is a valid result.
    assert code in (0, 1) and "Python" in output


def test_the_meshers_are_installed(type_in):
    code, output = type_in("./gravcomp mesh install")
    # 3: without root, the line that installs Gmsh's system libraries is printed.
    assert (code == 0 and "Gmsh" in output) or (code == 3 and "apt-get install" in output), output


def test_the_source_is_checked(type_in):
    """Style and types of the whole source; `src/test/test_check.py` has how the command reports and keeps what it finds."""
    code, output = type_in("./gravcomp check")
    assert code == 0 and all(f"{name}: passed" in output for name in CHECKS), output


def test_gravity_is_estimated_offline(type_in, folder):
    """`src/test/test_estimate_command.py` has what each of these lines prints and writes."""
    documented("./gravcomp estimate FILE")
    option, path = documented("./gravcomp estimate FILE --out gravity.npz")[3:]
    code, output = type_in("./gravcomp estimate FILE --json", f"{option} {path}", FILE=RECORDED)
    assert code == 0 and (folder / path).exists(), output


def test_a_robot_is_calibrated_to_measured_tips(type_in, folder):
    from gravcomp.description import load_robot_file
    from gravcomp.simulation import Simulator

    robot = load_robot_file("article").robot.with_material(youngs_modulus=330e3)
    simulator = Simulator(robot)
    rows = [
        "trial,time_s,gravity_x,gravity_y,gravity_z,"
        + ",".join(f"{name}_mm" for name in robot.cable_names)
        + ",tip_x_mm,tip_y_mm,tip_z_mm"
    ]
    for trial, gravity in enumerate(([-9.81, 0.0, 0.0], [0.0, -9.81, 0.0], [-6.9, 0.0, -6.9], [0.0, 6.9, -6.9])):
        tip = 1e3 * simulator.solve(gravity).tip_position
        rows += [",".join(map(str, [trial, 0.05 * k, *gravity, *[""] * len(robot.cables), *tip.round(4)])) for k in range(30)]
    (folder / "measured.csv").write_text("\n".join(rows), encoding="utf-8")
    line = "./gravcomp calibrate DATA.csv --robot ROBOT.yaml --write CALIBRATED.yaml"
    code, output = type_in(line, DATA="measured.csv", ROBOT="ROBOT.yaml", CALIBRATED="calibrated.yaml")
    assert code == 0, output
    # With released cables the tips determine the modulus only, to within the rounding of a tenth of a micrometre.
    modulus = load_robot_file(str(folder / "calibrated.yaml")).robot.segments[0].material.youngs_modulus
    assert modulus == pytest.approx(330e3, rel=1e-3)


@pytest.mark.parametrize(("line", "core"), [("./gravcomp test", False), ("./gravcomp test --fast", True)])
def test_tests_are_found(type_in, line, core):
    """Those of the core are left out, of `--fast` most of them: the run that this test is part of has found them."""
    code, output = type_in(line, f"--collect-only -q --ignore-glob=src/test/{'test_[!g]*' if core else '*'}")
    assert code == 0 and re.search(r"\d+ tests collected", output), output[-2000:]
    assert ("deselected" in output) is core and "test_guard" not in output  # it has the mark slow
    found = {folder: f"\n{folder}/test_" in output for folder in ("src/test", "gravcomp_fem/test")}  # as its first word
    assert found == {"src/test": core, "gravcomp_fem/test": not core} and ("test/test_demo.py" in output) is not core


def test_some_tests_are_run(type_in):
    code, output = type_in("./gravcomp test src/test/test_inverse.py -x", "-k straight")
    assert code == 0 and re.search(r"\d+ passed", output), output[-2000:]


@pytest.mark.skipif(Path("/sys/class/net/can0").exists(), reason="there is a can0: motors may hang on it")
@pytest.mark.parametrize(
    "line",
    [
        "./gravcomp up ROBOT.yaml --interface socketcan --channel can0 --viewer",
        "./gravcomp up left.yaml --namespace /left --interface socketcan --channel can0",
        "./gravcomp up right.yaml --namespace /right --interface socketcan --channel can1",
        "./gravcomp up robot.yaml --namespace /soft --interface socketcan --channel can0",
        "./gravcomp doctor --robot ROBOT.yaml --interface socketcan --channel can0",
    ],
)
def test_a_missing_can_device_is_reported(type_in, line):
    code, output = type_in(line, ROBOT="ROBOT.yaml")
    assert code == (1 if "doctor" in line else 2) and re.search(r"can[01]", output), output
    assert "Traceback" not in output


@pytest.mark.skipif(Path("/sys/class/net/can0").exists(), reason="there is a can0: motors may hang on it")
@pytest.mark.parametrize(
    "line",
    [
        "ros2 run gravcomp_hw can_bridge --ros-args -p robot:=my_robot.yaml -p interface:=socketcan -p channel:=can0",
        "ros2 run gravcomp_hw can_bridge --ros-args -p interface:=socketcan -p channel:=can0 -p zero:=home",
    ],
)
def test_a_bridge_without_its_can_device_reports_it(folder, monkeypatch, line):
    documented(line)
    monkeypatch.chdir(folder)
    code, output = run_node(line, dict(os.environ))
    assert code == 2 and "can0" in output and "Traceback" not in output
