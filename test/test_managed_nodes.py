"""Nodes as users of ros2cli see them: the whole lifecycle, reports of nodes that fail, parameters dumped and loaded."""

import signal
import time

import pytest

rclpy = pytest.importorskip("rclpy", reason="it starts nodes: ./gravcomp test")

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import ReliabilityPolicy
from ros2_line import Ros2
from std_srvs.srv import SetBool, Trigger

from gravcomp.launcher import NodeProcess, NodeSpec
from gravcomp_msgs.msg import ControllerStatus, ImuStatus

pytestmark = [pytest.mark.nodes, pytest.mark.timeout(300)]


class Observer(Ros2):
    """Runs lines and receives diagnostics."""

    def __init__(self):
        super().__init__()
        self.diagnostics: dict[str, tuple[bytes, str]] = {}
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics[status.name.lstrip("/")] = (status.level, status.message)


@pytest.fixture(scope="module")
def observer():
    observer = Observer()
    yield observer
    observer.close()


@pytest.fixture
def start(tmp_path, observer):
    """Return a function that starts a node and waits until it answers."""
    processes = []

    def start(package: str, executable: str, **parameters) -> NodeProcess:
        processes.append(NodeProcess(NodeSpec(package, executable, parameters), tmp_path / f"{executable}.log"))
        observer.state_of(f"/{executable}")
        return processes[-1]

    start.processes, start.folder = processes, tmp_path
    yield start
    for process in processes:
        process.stop()


def test_a_node_that_is_shut_down_is_finalized_and_stays(start, observer):
    process = start("gravcomp_estimation", "imu_estimator")
    observer.run("ros2 lifecycle set /imu_estimator active_shutdown")
    assert observer.state_of("/imu_estimator") == "finalized"
    observer.until(lambda: "shut down" in observer.diagnostics.get("imu_estimator", (b"", ""))[1], "the end is not reported")
    assert process.exit_code is None


def test_diagnostics_report_a_node_that_does_not_work(start, observer):
    start("gravcomp_estimation", "imu_estimator")
    for transition, said in (("deactivate", "not active"), ("cleanup", "not configured")):
        observer.run(f"ros2 lifecycle set /imu_estimator {transition}")
        observer.until(
            lambda said=said: observer.diagnostics.get("imu_estimator", (b"", ""))[1] == said, f"it is not said: {said}"
        )
        assert observer.diagnostics["imu_estimator"][0] == b"\x01"


def test_a_late_subscriber_receives_that_the_estimator_is_not_active(start, observer):
    start("gravcomp_estimation", "imu_estimator")
    observer.run("ros2 lifecycle set /imu_estimator deactivate")
    heard = observer.listen(ImuStatus, "imu/status", latched=True)
    observer.until(lambda: heard, "no latched status")
    assert heard[-1].code == ImuStatus.NO_DATA and heard[-1].message == "not active"


def test_a_controller_that_is_not_active_refuses_its_services(start, observer):
    start("gravcomp_fem", "inverse_controller")
    observer.run("ros2 lifecycle set /inverse_controller deactivate")
    for kind, name, request in ((SetBool, "enable", SetBool.Request(data=True)), (Trigger, "relax", Trigger.Request())):
        answer = observer.ask(kind, f"/inverse_controller/{name}", request)
        assert not answer.success and "not active" in answer.message
    observer.run("ros2 lifecycle set /inverse_controller activate")
    assert observer.ask(Trigger, "/inverse_controller/relax", Trigger.Request()).success


def test_a_refused_target_is_reported_for_seconds_and_in_the_log(start, observer, tmp_path):
    """Also without deformation, which the controller reports several times a second."""
    start("gravcomp_fem", "inverse_controller")
    heard = observer.listen(ControllerStatus, "controller/status")
    observer.until(lambda: heard and heard[-1].code == ControllerStatus.STALE, "it does not report that no deformation comes")
    observer.run(
        "ros2 topic pub --once /target/shape gravcomp_msgs/msg/ShapeTarget"
        " '{bend: true, bend_angle: 50.0, tip_position_weight: 1.0}'"
    )
    refused: list[int] = []

    def is_over() -> bool:
        refused[:] = [number for number, status in enumerate(heard) if "at most a full turn" in status.message]
        return bool(refused) and refused[-1] + 1 < len(heard)

    # By the stamps of all that the controller has published, because this process may receive it late.
    observer.until(is_over, "it is not refused, or for ever")
    assert stamp(heard[refused[-1] + 1]) - stamp(heard[refused[0]]) > 2.0
    assert ControllerStatus.STALE in {heard[number].code for number in refused}
    assert refused == list(range(refused[0], refused[-1] + 1))
    end = time.monotonic() + 60.0
    while "at most a full turn" not in (log := (tmp_path / "inverse_controller.log").read_text(encoding="utf-8")):
        assert time.monotonic() < end, log
        time.sleep(0.1)


def stamp(status: ControllerStatus) -> float:
    return status.header.stamp.sec + 1e-9 * status.header.stamp.nanosec


def test_a_dump_with_unset_parameters_can_be_loaded(start, observer):
    """`ros2 param dump` writes null for these parameters."""
    start("gravcomp_estimation", "imu_estimator", **{"heater.target": None, "heater.ambient": 21.0})
    assert observer.state_of("/imu_estimator") == "active"
    assert "successful" in observer.run("ros2 param set /imu_estimator heater.ambient None")


def test_a_change_of_a_parameter_is_an_event_and_a_refused_one_is_not(start, observer):
    start("gravcomp_estimation", "imu_estimator")
    events = observer.listen(ParameterEvent, "/parameter_events")
    line, values = "ros2 param set /imu_estimator prediction.horizon_ms", iter(range(1, 100))

    def is_heard() -> bool:  # the event of an earlier change may have come before the node knew of the subscription
        with pytest.raises(AssertionError, match=r"out of range Min: 0\.0, Max: 500\.0, value: 501\.0"):
            observer.run(f"{line} 501.0")
        observer.run(f"{line} {next(values)}.0")
        return any(event.changed_parameters for event in events if event.node == "/imu_estimator")

    observer.until(is_heard, "no event comes")
    changes = [change for event in events if event.node == "/imu_estimator" for change in event.changed_parameters]
    assert {change.name for change in changes} == {"prediction.horizon_ms"}
    assert all(change.value.double_value < 500.0 for change in changes)


def test_a_node_ends_without_error_messages(start, observer, tmp_path):
    process = start("gravcomp_fem", "inverse_controller")
    process.stop()
    assert process.exit_code == 0 and "leaked" not in (tmp_path / "inverse_controller.log").read_text(encoding="utf-8")


def test_a_node_waits_at_its_gate_and_can_be_ended_there(start, observer):
    def gated(namespace: str) -> NodeProcess:
        spec = NodeSpec("gravcomp_estimation", "imu_estimator", namespace=namespace)
        process = NodeProcess(spec, start.folder / "imu_estimator.log", gated=True)
        start.processes.append(process)
        observer.until(lambda: f"{namespace}/imu_estimator" in observer.names(), "it does not start")
        end = time.monotonic() + 0.5
        observer.until(lambda: time.monotonic() > end, "")
        assert process.exit_code is None and not process.was_active
        return process

    process = gated("/opened")
    process.open_gate()
    assert observer.state_of("/opened/imu_estimator") == "active"
    observer.until(lambda: process.was_active, "it does not note that it is active")
    process.stop()
    process = gated("/ended")
    process.signal(signal.SIGINT)  # as by the kernel when the launcher ends
    observer.until(lambda: process.exit_code is not None, "it waits for ever")
    assert process.exit_code == 0 and not process.was_active


def test_three_nodes_in_one_process_are_three_nodes(start, observer):
    process = NodeProcess(
        NodeSpec("gravcomp_fem", "composed_loop", {"robot": "article", "inverse_controller:inverse.tolerance_mm": 3.0}),
        start.folder / "composed_loop.log",
    )
    start.processes.append(process)
    for name in ("imu_estimator", "fem_simulator", "inverse_controller"):
        assert observer.state_of(f"/{name}") == "active"
    assert process.was_active
    observer.run("ros2 param set /inverse_controller inverse.tolerance_mm 2.0")
    observer.run("ros2 lifecycle set /fem_simulator deactivate")
    assert observer.state_of("/fem_simulator") == "inactive" and observer.state_of("/imu_estimator") == "active"


def test_an_override_of_the_quality_of_service_is_applied_or_named(start, observer):
    wrong = "qos_overrides./no_topic.publisher.depth"
    right = "qos_overrides./robot/deformation.subscription.reliability"
    process = start("gravcomp_fem", "inverse_controller", **{right: "reliable", wrong: 3})
    observer.until(lambda: "inverse_controller" in observer.subscribers("/robot/deformation"), "it does not subscribe")
    (found,) = observer.subscriptions("/robot/deformation")
    assert found.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    assert f"parameter {wrong} overrides nothing" in process.log.read_text(encoding="utf-8")


def test_a_wrong_override_of_the_quality_of_service_ends_the_node(tmp_path):
    spec = NodeSpec("gravcomp_fem", "inverse_controller", {"qos_overrides./cable/command.publisher.reliability": "often"})
    process = NodeProcess(spec, tmp_path / "log")
    end = time.monotonic() + 60.0
    while process.exit_code is None:
        assert time.monotonic() < end
        time.sleep(0.1)
    assert process.exit_code == 2 and "`often`" in process.why()


def test_a_node_reports_while_the_clock_of_a_replay_stands_still(start, observer):
    start("gravcomp_fem", "inverse_controller", use_sim_time=True)
    observer.diagnostics.clear()
    observer.until(lambda: "inverse_controller" in observer.diagnostics, "no diagnostics")
