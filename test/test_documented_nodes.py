"""The documented lines that start graphs and nodes: your own robot, replayed bags, single nodes, two robots."""

import json
import os
import re
import shutil
import time
from operator import itemgetter
from pathlib import Path

import psutil
import pytest
from documents import documented

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

from ros2_line import Ros2, run_node
from shell import START, Shell, check_doctor, unless_stopped

from gravcomp.launcher.domain import reserve_domain
from gravcomp.view.browser import find_chromium
from gravcomp_msgs.msg import CableCommand

pytestmark = [pytest.mark.graph, pytest.mark.timeout(900)]

APART = reserve_domain()
SHORTEST = "--duration 10"
RECORDED = Path(__file__).parent / "data" / "imu_and_gravity"


@pytest.fixture(scope="module")
def demonstrated(folder):
    """Demonstrate an own robot, with pictures of its page where there is a browser. Returns code, output and folder of these."""
    documented("./gravcomp demo --robot src/examples/own_robot.yaml")
    words = documented("./gravcomp demo --robot src/examples/own_robot.yaml --seed 7")
    option = documented("./gravcomp demo --screenshots src/doc/pictures")[2]
    pictures = folder / "shown"  # the documented folder leads to the repository's pictures
    more = [option, str(pictures)] if find_chromium() else []
    line = [*words, *more, "--duration", "12", "--json"]
    code, output = unless_stopped(lambda: Shell(line, folder, dict(os.environ)).end(600.0), itemgetter(0))
    return code, output, pictures


@pytest.mark.rates
def test_an_own_robot_drawn_by_a_seed_is_compensated(demonstrated):
    """With the page, and with the seed of the second line; without it the seed is that of the file, as in every other demo."""
    code, output, _ = demonstrated
    assert code == 0 and "http://" in output, output
    figures = json.loads(next(line for line in output.splitlines() if line.startswith("{")))
    assert figures["seed"] == 7 and figures["sag_mm"] > 20.0
    assert figures["residual_lateral_mm"] < figures["sag_mm"] / 3.0


@pytest.mark.rates
@pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine: apt-get install chromium")
def test_pictures_of_the_page_show_each_moment(demonstrated):
    import numpy as np
    from PIL import Image

    code, output, folder = demonstrated
    assert code == 0, output
    middle = {}
    for name in ("sagging", "compensated", "tilted"):
        picture = np.asarray(Image.open(folder / f"{name}.png").convert("RGB")).astype(int)
        middle[name] = picture[:, 420:-420]
        # Thousands of colours next to the panels: shaded surfaces, not an empty canvas.
        assert len(np.unique(middle[name].reshape(-1, 3), axis=0)) > 2000
    # The robot is somewhere else in each.
    for a, b in (("sagging", "compensated"), ("compensated", "tilted")):
        assert (np.abs(middle[a] - middle[b]).max(axis=2) > 40).mean() > 0.003


def test_a_robot_with_joints_is_demonstrated(type_in):
    line = "./gravcomp demo --robot src/examples/joint_robot.yaml --headless"
    code, output = unless_stopped(lambda: type_in(line, SHORTEST), itemgetter(0))
    assert code == 0 and "sag without compensation" in output and "joint_bridge" in output, output


def test_the_firmware_is_the_board_of_a_demonstration(type_in):
    """With the loop on the board; `test_demo` has the firmware that carries frames only."""
    line = "./gravcomp demo --board standalone"
    code, output = unless_stopped(lambda: type_in(line, f"--headless {SHORTEST}"), itemgetter(0))
    assert code == 0 and "sag without compensation" in output, output


@pytest.fixture
def own_domain(monkeypatch):
    """A ROS domain without other nodes."""
    monkeypatch.setenv("ROS_DOMAIN_ID", APART)


@pytest.mark.nodes
@pytest.mark.parametrize(
    "line",
    [
        "ros2 run gravcomp_estimation imu_estimator",
        "ros2 run gravcomp_estimation imu_estimator --ros-args -p use_sim_time:=true",
        "ros2 run gravcomp_fem fem_simulator",
        "ros2 run gravcomp_fem inverse_controller",
        "ros2 run gravcomp_fem composed_loop --ros-args -p robot:=article -p imu_estimator:prediction.horizon_ms:=10.0",
        "ros2 run gravcomp_estimation arm_gravity --ros-args -r __ns:=/soft -p source:=tf -p world_frame:=world -p base_frame:=soft_base -p use:=check",  # noqa: E501 (a whole line of a document)
        "ros2 run gravcomp_estimation arm_gravity --ros-args -r __ns:=/soft -r joint_states:=/joint_states -r robot_description:=/robot_description -p use:=check",  # noqa: E501 (a whole line of a document)
        "ros2 run gravcomp_estimation imu_replay --ros-args -p file:=my_bag",
        "ros2 run gravcomp_estimation arm_gravity --ros-args -r __ns:=/left -r joint_states:=/joint_states -r robot_description:=/robot_description -p base_frame:=left_soft_base -p use:=check",  # noqa: E501 (a whole line of a document)
        "ros2 run gravcomp_estimation arm_gravity --ros-args -r __ns:=/right -r joint_states:=/joint_states -r robot_description:=/robot_description -p base_frame:=right_soft_base -p use:=check",  # noqa: E501 (a whole line of a document)
        "ros2 run gravcomp_hw joint_bridge --ros-args -r __ns:=/soft -r joint_states:=/joint_states -p robot:=src/examples/joint_robot.yaml",  # noqa: E501 (a whole line of a document)
        "ros2 run gravcomp_hw joint_robot --ros-args -p robot:=src/examples/joint_robot.yaml -p joints:=mock",
    ],
)
def test_a_node_runs_until_ctrl_c(folder, own_domain, monkeypatch, line):
    documented(line)
    if not (folder / "my_bag").exists():
        shutil.copytree(RECORDED, folder / "my_bag")
    monkeypatch.chdir(folder)
    code, output = run_node(line, dict(os.environ), interrupt=True)
    if "source:=tf" in line and code == 2:
        assert "tf2_msgs" in output  # part of an installed ROS only
        return
    assert code == 0 and "Traceback" not in output, output


def test_two_robots_run_side_by_side(folder, own_domain, type_in):
    lines = ("./gravcomp up --virtual --namespace /left --viewer", "./gravcomp up --virtual --namespace /right --viewer")
    ros2, shells = Ros2(), [Shell(documented(line), folder, dict(os.environ)) for line in lines]
    try:
        for shell in shells:
            shell.wait_for("The live page: http://")
        pages = {re.search(r"http://\S+", shell.output.read_text(encoding="utf-8")).group() for shell in shells}
        assert len(pages) == 2
        commands = {name: ros2.listen(CableCommand, f"/{name}/cable/command") for name in ("left", "right")}
        ros2.until(lambda: all(commands.values()), "a robot has no commands", START)
        # Two robots take all of a small machine. Without samples of its virtual robot the right one is there and takes little.
        halted = virtual_robot_of(shells[1])
        halted.suspend()
        try:
            end = time.monotonic() + START
            line = "./gravcomp doctor --graph --namespace /left"
            # On a busy machine what the doctor starts may not find the topics, or not answer, in its time.
            while any(words in (answer := type_in(line))[1] for words in ("nothing is published", "could not be checked")):
                assert time.monotonic() < end, answer[1]
            check_doctor(*answer)
        finally:
            halted.resume()
    finally:
        codes = [shell.ctrl_c() for shell in shells]
        ros2.close()
    assert codes == [130, 130]


def virtual_robot_of(shell: Shell) -> psutil.Process:
    """Return the process of the virtual robot that a command has started."""
    below = psutil.Process(shell.process.pid).children(recursive=True)
    return next(process for process in below if any(word.endswith("gravcomp_hw/virtual_robot") for word in process.cmdline()))
