"""Targets without equilibrium in the running graph: commands continue, and the next target is reached."""

import contextlib
from concurrent.futures import Future
from typing import NamedTuple

import psutil
import pytest

pytest.importorskip("rclpy", reason="it runs the graph: ./gravcomp test")

from ros2_line import Ros2
from shell import future

from gravcomp.launcher.virtual_graph import RunningGraph
from gravcomp_msgs.msg import CableCommand, ControllerStatus

pytestmark = [pytest.mark.graph, pytest.mark.timeout(1200)]


# Bend angle and plane in rad; the robot moves to where the model's equilibria end. `bench engine` measures the longest step.
WITHOUT_EQUILIBRIUM = ((4.5, 0.0), (5.5, 1.0))

AT_THE_END = (ControllerStatus.UNREACHABLE, ControllerStatus.RELAXING)


class Found(NamedTuple):
    """What was found in the running graph, each as a future, which raises in the test what was raised while the graph ran.

    recovered: by target; hold: the status that says whether the target at the start can be held.
    """

    recovered: dict[tuple[float, float], Future]
    hold: Future


@pytest.fixture(scope="module")
def found():
    """Give the targets to a running graph. The answer about the hold is computed meanwhile, by a process of low priority."""
    ros2 = Ros2()
    try:
        with RunningGraph({"virtual_robot": {"feedback_rate": 125}}) as graph:
            drive(graph, ros2)
            statuses = ros2.listen(ControllerStatus, f"{graph.namespace}/controller/status", latched=True)
            commands = ros2.listen(CableCommand, f"{graph.namespace}/cable/command")
            recovered = {target: future(recover, graph, ros2, statuses, commands, *target) for target in WITHOUT_EQUILIBRIUM}
            return Found(recovered, future(wait_for_hold, graph, ros2, statuses))
    finally:
        ros2.close()


def drive(graph: RunningGraph, ros2: Ros2) -> None:
    """Wait until commands are followed; resume once a bridge that a busy machine has stopped at the start."""
    try:
        graph.wait_for_commands()
    except TimeoutError:
        if not graph.latched_fault():
            raise
        ros2.run(f"ros2 service call {graph.namespace}/can_bridge/resume std_srvs/srv/Trigger")
        ros2.until(lambda: not graph.latched_fault(), "the bridge does not resume")
        graph.wait_for_commands()


def recover(graph: RunningGraph, ros2: Ros2, statuses: list, commands: list, angle: float, plane: float) -> None:
    """Give a target without equilibrium, and the straight one."""
    pub = f"ros2 topic pub --once {graph.namespace}/target/shape gravcomp_msgs/msg/ShapeTarget"
    ros2.until(lambda: commands and statuses, "no commands")
    before = len(statuses)
    ros2.run(f"{pub} '{{bend: true, bend_angle: {angle}, bend_plane: {plane}, tip_position_weight: 1.0}}'")
    # There the robot is where the model's equilibria end, at first it is on its way.
    ros2.until(lambda: any(s.code in AT_THE_END for s in statuses[before:]), "the status does not call the target out of reach")
    there = len(commands)
    ros2.until(lambda: len(commands) > there + 50, "no commands follow while the target has no equilibrium")
    ros2.run(f"{pub} '{{bend: true, bend_angle: 0.0, tip_position_weight: 1.0, tip_direction_weight: 0.001}}'")
    ros2.until(
        lambda: statuses[-1].code == ControllerStatus.OK and statuses[-1].distance < 3e-3, "the straight target is not reached"
    )
    graph.check()


def wait_for_hold(graph: RunningGraph, ros2: Ros2, statuses: list) -> ControllerStatus:
    """Return the first status with the answer.

    The process that computes it has the lowest priority, so it waits for the other tests. Meanwhile the virtual robot is halted:
    without its samples the graph takes no processor.
    """
    robot, controller = graph.process("virtual_robot"), graph.process("inverse_controller")
    robot.suspend()
    try:
        ros2.until(lambda: not is_computing(controller), "the question is not answered", 500.0)
    finally:
        robot.resume()
    ros2.until(lambda: statuses and statuses[-1].holdable != 0, "the answer is not published")
    return statuses[-1]


def is_computing(controller: psutil.Process) -> bool:
    """Return whether the controller's only process, which answers, runs; the controller waits for its end with a sample."""
    for child in controller.children():
        with contextlib.suppress(psutil.NoSuchProcess):
            if child.status() != psutil.STATUS_ZOMBIE:
                return True
    return False


def test_the_status_says_whether_the_target_can_be_held(found):
    status = found.hold.result()
    assert status.holdable == 1 and "the cables hold the tip" in status.hold_message


@pytest.mark.parametrize("target", WITHOUT_EQUILIBRIUM)
def test_the_robot_recovers_from_a_target_without_equilibrium(found, target):
    found.recovered[target].result()
