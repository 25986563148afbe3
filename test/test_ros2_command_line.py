"""The true `ros2` command line on a running node and on the launch files: lines that no document tells the reader to type.

It has no wheels: the tests are skipped where `ros2` is not installed.
"""

import os
import re
import shlex
import shutil
import subprocess

import pytest

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")
if not shutil.which("ros2"):
    pytest.skip("the ros2 command line is part of an installed ROS", allow_module_level=True)

from ros2_line import PATIENCE, Ros2

pytestmark = [pytest.mark.graph, pytest.mark.timeout(900)]

ON_A_NODE = (
    ("node list", r"^/imu_estimator$"),
    ("node info /imu_estimator", r"/gravity: geometry_msgs/msg/Vector3Stamped"),
    ("topic list -t", r"/imu/status \[gravcomp_msgs/msg/ImuStatus\]"),
    ("topic info -v /imu/data_raw", r"Subscription count: 1"),
    ("param list /imu_estimator", r"filter\.velocity_noise"),
    ("param get /imu_estimator filter.velocity_noise", r"0\.15"),
    ("param dump /imu_estimator", r"velocity_noise: 0\.15"),
    ("param load /imu_estimator {file}", r"filter\.velocity_noise successful"),
    ("service type /imu_estimator/reset", r"std_srvs/srv/Trigger"),
    ("service call /imu_estimator/reset std_srvs/srv/Trigger", r"success=True"),
    ("lifecycle nodes", r"^/imu_estimator$"),
    ("lifecycle list /imu_estimator", r"deactivate \[4\]"),
    ("lifecycle set /imu_estimator deactivate", r"successful"),
    ("lifecycle get /imu_estimator", r"inactive"),
    ("lifecycle set /imu_estimator activate", r"successful"),
    ("topic pub --once /imu/data_raw sensor_msgs/msg/Imu '{{header: auto, linear_acceleration: {{z: 9.81}}}}'", r"publishing #1"),
    ("topic echo --once /imu/status --field rejected", r"^\d+$"),
)

WITHOUT_A_NODE = (
    ("pkg executables gravcomp_hw", r"gravcomp_hw can_bridge"),
    ("interface show gravcomp_msgs/msg/CableState", r"float64\[\] tension +# N"),
    ("launch gravcomp_fem robot.launch.py --show-args", r"'composed':\n +true: run estimator"),
    ("launch gravcomp_fem robot.launch.yaml --show-args", r"'channel':\n +channel of the interface"),
)


def ros2(line: str) -> str:
    """Return what a line prints; a line that fails raises AssertionError."""
    done = subprocess.run(["ros2", *shlex.split(line)], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def node():
    """A node that `ros2 run` starts."""
    graph = Ros2()
    process = subprocess.Popen(["ros2", "run", "gravcomp_estimation", "imu_estimator"], start_new_session=True)
    try:
        graph.until(lambda: "/imu_estimator" in graph.names() and graph.state_of("/imu_estimator") == "active", "no active node")
        yield process
    finally:
        graph.close()
        os.killpg(process.pid, 2)
        process.wait(PATIENCE)


def test_the_command_line_works_on_a_running_node(node, tmp_path):
    file = tmp_path / "parameters.yaml"
    file.write_text("/imu_estimator: {ros__parameters: {filter: {velocity_noise: 0.2}}}", encoding="utf-8")
    for line, printed in ON_A_NODE:
        assert re.search(printed, ros2(line.format(file=file)), re.MULTILINE), line


def test_the_command_line_finds_executables_messages_and_launch_files():
    for line, printed in WITHOUT_A_NODE:
        assert re.search(printed, ros2(line)), line
