"""Targets without equilibrium in the running graph: commands continue, and the next target is reached."""

import pytest

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

from ros2_line import Ros2

from gravcomp.launcher.virtual_graph import RunningGraph
from gravcomp_msgs.msg import CableCommand, ControllerStatus

pytestmark = [pytest.mark.graph, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def graph():
    with RunningGraph({"virtual_robot": {"feedback_rate": 125}}) as graph:
        graph.wait_for_commands()
        yield graph


@pytest.fixture(scope="module")
def ros2(graph):
    ros2 = Ros2()
    yield ros2
    ros2.close()


def test_the_status_says_whether_the_target_can_be_held(graph, ros2):
    """The answer comes some seconds after the start, from a process of low priority, which waits for the other tests."""
    statuses = ros2.listen(ControllerStatus, f"{graph.namespace}/controller/status", latched=True)
    ros2.until(lambda: statuses and statuses[-1].holdable != 0, "no answer comes", 500.0)
    assert statuses[-1].holdable == 1 and "the cables hold the tip" in statuses[-1].hold_message


@pytest.mark.parametrize(("angle", "plane"), [(4.5, 0.0), (5.5, 1.0)])
def test_the_robot_recovers_from_a_target_without_equilibrium(graph, ros2, angle, plane):
    """The robot moves to where the model's equilibria end, and recovers. `bench engine` measures the longest step."""
    commands = ros2.listen(CableCommand, f"{graph.namespace}/cable/command")
    statuses = ros2.listen(ControllerStatus, f"{graph.namespace}/controller/status", latched=True)
    pub = f"ros2 topic pub --once {graph.namespace}/target/shape gravcomp_msgs/msg/ShapeTarget"
    ros2.until(lambda: commands and statuses, "no commands")
    before = len(statuses)
    ros2.run(f"{pub} '{{bend: true, bend_angle: {angle}, bend_plane: {plane}, tip_position_weight: 1.0}}'")
    ros2.until(lambda: any(s.code != ControllerStatus.OK for s in statuses[before:]), "the status calls the target reached")
    there = len(commands)
    ros2.until(lambda: len(commands) > there + 300, "no commands follow while the target has no equilibrium")
    ros2.run(f"{pub} '{{bend: true, bend_angle: 0.0, tip_position_weight: 1.0, tip_direction_weight: 0.001}}'")
    ros2.until(
        lambda: statuses[-1].code == ControllerStatus.OK and statuses[-1].distance < 3e-3, "the straight target is not reached"
    )
    graph.check()
