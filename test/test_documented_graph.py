"""The documented lines that talk to a running graph: one virtual robot that runs as the tutorial says.

The graph takes a processor as long as it runs. So all lines that need it run in one go, those that only listen at the same time,
and the tests check what they gave; what evaluates a recording runs after the graph.
"""

import os
import re
import time
from concurrent.futures import Future
from pathlib import Path
from typing import NamedTuple

import pytest
from documents import documented

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

from ros2_line import Ros2
from sensor_msgs.msg import Imu
from shell import START, Shell, check_doctor, future

pytestmark = [pytest.mark.rates, pytest.mark.timeout(900)]


PUBLISHED_ONCE = (
    "ros2 topic pub --once /target/shape gravcomp_msgs/msg/ShapeTarget '{bend: true, bend_angle: 0.5, tip_position_weight: 1.0}'"
)

# Lines, and what they print. These only ask.
LISTENING_LINES = (
    ("ros2 lifecycle get /can_bridge", "active"),
    ("ros2 param describe /inverse_controller inverse.tolerance_mm", "inverse.tolerance_mm"),
    ("ros2 topic hz /cable/command", r"average rate: \d"),
    ("ros2 topic echo /controller/status --field message", "target"),
)

# In this order: what one line disables, the next enables.
ROS2_LINES = (
    ("ros2 param set /inverse_controller inverse.tolerance_mm 3.0", "successful"),
    ("ros2 param set /inverse_controller inverse.axial_weight 0.1", "successful"),
    ("ros2 param set /inverse_controller inverse.max_contact_force 0.05", "successful"),
    (PUBLISHED_ONCE, "publishing"),
    (
        "ros2 topic pub --once /target/shape gravcomp_msgs/msg/ShapeTarget '{bend: true, bend_angle: 0.5, bend_plane: 1.57, tip_position_weight: 1.0}'",  # noqa: E501 (a whole line of a document)
        "publishing",
    ),
    ("ros2 service call /inverse_controller/relax std_srvs/srv/Trigger", "success=True"),
    ("ros2 service call /inverse_controller/enable std_srvs/srv/SetBool '{data: true}'", "success=True"),
    ("ros2 lifecycle set /inverse_controller deactivate", "successful"),
    ("ros2 lifecycle set /inverse_controller activate", "successful"),
    ("ros2 param set /fem_simulator payload_mass_g 3.0", "successful"),
    ("ros2 service call /can_bridge/home std_srvs/srv/Trigger", "success=True"),
    ("ros2 service call /can_bridge/stop std_srvs/srv/Trigger", "success=True"),
)


class Lines(NamedTuple):
    """What the lines gave, each as a future, which raises in the test what was raised while the graph ran."""

    doctor: Future
    recorder: Future
    poses: Future
    listened: Future
    changed: Future
    up: Future


@pytest.fixture(scope="module")
def lines(folder):
    """Run a virtual robot as the tutorial says, and type the lines next to it."""
    ros2, graph = Ros2(), in_background(folder, "./gravcomp up --virtual --viewer")
    try:
        graph.wait_for("The live page: http://")
        wait_for_target(ros2)
        recorder = in_background(folder, "./gravcomp record --out my_bag --duration 60")
        doctor = in_background(folder, "./gravcomp doctor --graph")
        poses = in_background(folder, "./gravcomp record --out poses --topics imu/data_raw imu/temperature", "--duration 5")
        recorded, listened = future(record, ros2, recorder), future(ask, ros2, LISTENING_LINES)
        examined, posed = future(doctor.end), future(poses.end)
        # These disturb the graph: after those that listen.
        changed = future(ask, ros2, ROS2_LINES)
        return Lines(examined, recorded, posed, listened, changed, future(graph.ctrl_c))
    finally:
        if graph.process.poll() is None:
            graph.ctrl_c()
        ros2.close()


def in_background(folder: Path, line: str, shorter: str = "") -> Shell:
    return Shell([*documented(line), *shorter.split()], folder, dict(os.environ))


def wait_for_target(ros2: Ros2) -> None:
    end = time.monotonic() + START
    while "target" not in (said := ros2.run("ros2 topic echo /controller/status --field message")):
        assert time.monotonic() < end, said
        time.sleep(0.5)


def record(ros2: Ros2, recorder: Shell) -> tuple[int, str]:
    """Publish a message once while the recorder runs, and end it."""
    ros2.until(lambda: "recorder" in ros2.subscribers("/target/shape"), "the recorder does not find the topics")
    samples = ros2.listen(Imu, "/imu/data_raw")
    ros2.until(lambda: len(samples) > 100, "no samples")
    ros2.run(PUBLISHED_ONCE)
    ros2.until(lambda: len(samples) > 500, "no samples")
    return recorder.ctrl_c(), recorder.output.read_text(encoding="utf-8")


def ask(ros2: Ros2, lines: tuple[tuple[str, str], ...]) -> None:
    for line, printed in lines:
        documented(line)
        assert re.search(printed, ros2.run(line)), line
    if lines is ROS2_LINES:
        ros2.run("ros2 service call /can_bridge/resume std_srvs/srv/Trigger")  # after the stop of the last line


def test_the_doctor_examines_the_running_graph(lines):
    code, output = lines.doctor.result()
    check_doctor(code, output)
    assert "every subscription is compatible with its publishers" in " ".join(output.split()), output


def test_the_running_graph_is_recorded_and_evaluated(lines, type_in, folder):
    from gravcomp.commands.record import describe

    code, output = lines.recorder.result()
    assert code == 0, output
    # A message that was published once, by a node that ended since, is recorded as well.
    topics = describe(folder / "my_bag")["topics"]
    assert topics["/target/shape"] == 1 and topics["/imu/data_raw"] > 400
    code, output = type_in("./gravcomp reproduce all --bag my_bag")
    assert code in (0, 1) and "Keeping the shape, recorded" in output and "cables commanded, median" in output, output


def test_an_imu_is_calibrated_from_a_recording(lines, type_in, folder):
    code, output = lines.poses.result()
    assert code == 0, output
    # The base is at rest: one pose, which is too few for the scale but enough for the offset of the gyroscope.
    code, output = type_in("./gravcomp calibrate-imu poses --write my_robot.yaml", "--robot article")
    assert code == 0 and "gyroscope" in (folder / "my_robot.yaml").read_text(encoding="utf-8"), output


def test_each_ros2_line_does_what_it_says(lines):
    lines.listened.result()
    lines.changed.result()


def test_the_graph_runs_until_ctrl_c(lines):
    assert lines.up.result() == 130
