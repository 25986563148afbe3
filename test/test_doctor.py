"""The running graph: its nodes have the topics and services of the table of nodes, and the doctor measures the graph.

The graph takes a processor as long as it runs. So all that needs it is done in one go, and the tests check what was found.
"""

import functools
import importlib
import json
import os
import re
import subprocess
import time
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

rclpy = pytest.importorskip("rclpy", reason="it looks at the running graph: ./gravcomp test")

from shell import future

from gravcomp.graph.nodes import NODES, node
from gravcomp.launcher import Graph
from gravcomp.launcher.domain import reserve_domain
from gravcomp.launcher.host_client import NodeHost
from gravcomp.launcher.robot_graph import LOOP, RobotGraph

pytestmark = [pytest.mark.rates, pytest.mark.timeout(600)]

# With a namespace, because nothing must depend on an empty one.
NAMESPACE = "/left"
DOCTOR = (str(Path(__file__).resolve().parents[1] / "gravcomp"), "doctor", "--graph", "--namespace", NAMESPACE, "--json")
DOMAIN = reserve_domain()
START = 300.0  # s; a machine that has never run the graph compiles first
# Ports of every node: those of rclpy, of the parameters and of the lifecycle.
COMMON_TOPICS = {"/rosout", "/parameter_events", "/clock"}
COMMON_SERVICES = ("rcl_interfaces/", "lifecycle_msgs/", "type_description_interfaces/")
RATED = {port.name: port.type for entry in NODES for port in entry.publishes if port.rate is not None}


class Found(NamedTuple):
    """What was found in the running graph, each as a future, which raises in the test what was raised while the graph ran.

    regular: findings about topics that come at their rates; unserved: exit code and findings while this process demands what the
    estimator does not offer; compared: the ports of every node were compared with the table.
    """

    regular: Future
    unserved: Future
    compared: Future


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Run the loop on a virtual robot, as processes, and look at it."""
    from geometry_msgs.msg import Vector3Stamped

    from gravcomp.canbus.multicast import private_channel

    motion = {"motion": "topic", "truth_rate": 50.0, "feedback_rate": 125}
    graph = RobotGraph("article", "udp_multicast", private_channel(), NAMESPACE, {"virtual_robot": motion})
    specs = [*graph.loop(), graph.node("gravcomp_hw", "virtual_robot")]
    logs = tmp_path_factory.mktemp("logs")
    with Graph(specs, logs, {"ROS_DOMAIN_ID": DOMAIN}, NodeHost()) as processes, observing() as observer:
        processes.start()
        regular = future(regular_findings, observer, processes)
        demanding = observer.create_subscription(Vector3Stamped, f"{NAMESPACE}/gravity", lambda _: None, 10)
        doctor = subprocess.Popen(DOCTOR, stdout=subprocess.PIPE, text=True, env={**os.environ, "ROS_DOMAIN_ID": DOMAIN})
        try:
            compared = future(compare_with_the_table, observer, graph, processes, tmp_path_factory.mktemp("more"))
            unserved = future(findings_of, doctor)
        finally:
            doctor.kill()  # nothing happens where the process has ended
        observer.destroy_subscription(demanding)
        processes.check()
    return Found(regular, unserved, compared)


@contextmanager
def observing():
    """Context with a node that asks the middleware for the nodes and topics of the graph."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=int(DOMAIN))
    observer = rclpy.create_node("doctors_test", context=context)
    try:
        yield observer
    finally:
        observer.destroy_node()
        rclpy.shutdown(context=context)


def findings_of(doctor: subprocess.Popen) -> tuple[int, list[dict]]:
    """Return exit code and findings of the doctor when it ends."""
    printed, _ = doctor.communicate(timeout=START)
    return doctor.returncode, json.loads(printed.strip().splitlines()[-1])["findings"]


def until(done, what, processes, patience=START):
    end = time.monotonic() + patience
    while not done():
        processes.check()
        assert time.monotonic() < end, what
        time.sleep(0.2)


def rates(finding: dict) -> tuple[float, float]:
    """Return the measured and the declared rate (Hz) of a finding about a topic."""
    words = re.match(r"(\d+) Hz of (\d+)", finding["found"])
    return (float(words[1]), float(words[2])) if words else (0.0, 1.0)


def is_there(observer, executable: str) -> bool:
    return (executable, NAMESPACE) in observer.get_node_names_and_namespaces()


def interface(observer, executable: str) -> tuple[dict, dict, dict]:
    """What a running node takes, gives and serves, name to type; what every node has left out."""
    found = []
    for query in (observer.get_subscriber_names_and_types_by_node, observer.get_publisher_names_and_types_by_node):
        topics = {name: kinds[0] for name, kinds in query(executable, NAMESPACE)}
        found.append({n: k for n, k in topics.items() if n not in COMMON_TOPICS and not n.endswith("/transition_event")})
    services = {name: kinds[0] for name, kinds in observer.get_service_names_and_types_by_node(executable, NAMESPACE)}
    return *found, {n: k for n, k in services.items() if not k.startswith(COMMON_SERVICES)}


def resolved(ports, executable: str) -> dict[str, str]:
    """Return the types of ports by their full names."""
    names = {p.name: p.name.replace("~", f"{NAMESPACE}/{executable}") for p in ports}
    return {n if n.startswith("/") else f"{NAMESPACE}/{n}": next(p.type for p in ports if p.name == k) for k, n in names.items()}


def agrees(found: dict, ports: tuple, executable: str) -> bool:
    """Check that all ports are found that are not optional, and nothing else."""
    declared = resolved([p for p in ports if p.name not in COMMON_TOPICS], executable)
    needed = resolved([p for p in ports if not p.optional and p.name not in COMMON_TOPICS], executable)
    return needed.items() <= found.items() <= declared.items()


def regular_findings(observer, processes) -> dict[str, dict]:
    """Return the findings by subject, as soon as all topics come regularly."""
    # Wait until everything is compiled and follows commands; before that the topics are silent.
    heard = set()
    for name, kind in RATED.items():
        take = functools.partial(lambda n, _: heard.add(n), name)
        observer.create_subscription(message_class(kind), f"{NAMESPACE}/{name}", take, rclpy.qos.qos_profile_sensor_data)
    executor = rclpy.executors.SingleThreadedExecutor(context=observer.context)
    executor.add_node(observer)
    until(lambda: executor.spin_once(0.1) or heard == set(RATED), f"silent: {set(RATED) - heard}", processes)
    executor.remove_node(observer)
    found = {}

    def regular() -> bool:
        """Whether all topics come regularly, as far as a slow machine allows; a loop that leaves samples out has half."""
        doctor = subprocess.Popen(DOCTOR, stdout=subprocess.PIPE, text=True, env={**os.environ, "ROS_DOMAIN_ID": DOMAIN})
        found.update({f["subject"]: f for f in findings_of(doctor)[1]})
        return all(0.55 * wanted < rate < 1.1 * wanted for rate, wanted in (rates(found[name]) for name in RATED))

    try:
        until(regular, "", processes, 120.0)
    except AssertionError:
        raise AssertionError(f"not at their rates: {found}") from None
    return found


def compare_with_the_table(observer, graph: RobotGraph, processes: Graph, folder: Path) -> None:
    """Compare the ports of the running nodes, and of those that only some graphs have, with the table of nodes."""
    from gravcomp.arm.description import expanded, shipped_xacro

    urdf = folder / "arm.urdf"
    urdf.write_text(expanded(shipped_xacro("seven_axis_arm.urdf.xacro")), encoding="utf-8")
    more = [
        graph.node("gravcomp_fem", "viewer", port=8860),
        graph.node("gravcomp_estimation", "arm_gravity", urdf=str(urdf)),
        graph.node("gravcomp_fem", "arm_player", urdf=str(urdf), hold=600.0),  # its tour does not end meanwhile
        graph.node("gravcomp_hw", "judge", duration=3600.0),
    ]
    names = [executable for _, executable in LOOP] + ["virtual_robot"] + [spec.executable for spec in more]
    for spec in more:
        processes.start_one(spec)
    for executable in names:
        until(functools.partial(is_there, observer, executable), f"no {executable}", processes)
        try:
            # A node creates its last ports at its activation.
            until(functools.partial(fits_the_table, observer, executable), "", processes, 60.0)
        except AssertionError:
            raise AssertionError(f"{executable} is not what the table says: {interface(observer, executable)}") from None


def fits_the_table(observer, executable: str) -> bool:
    """Return whether a running node has the ports of the table of nodes."""
    entry = node(executable)
    takes, gives, services = interface(observer, executable)
    return (
        agrees(takes, entry.subscribes, executable)
        and agrees(gives, entry.publishes, executable)
        and agrees(services, entry.services, executable)
    )


def message_class(kind: str) -> type:
    package, _, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def test_the_doctor_finds_rates_delays_and_fitting_qos(found):
    findings = found.regular.result()
    for name in RATED:
        rate, wanted = rates(findings[name])
        assert "behind its IMU sample" in findings[name]["found"], findings[name]
        if abs(rate - wanted) != 0.05 * wanted:  # the rate is rounded, so that this one may be either
            assert (findings[name]["level"] == "ok") == (abs(rate - wanted) < 0.05 * wanted), findings[name]
    assert findings["QoS"]["level"] == "ok"


def test_the_doctor_names_a_subscription_that_cannot_be_served(found):
    code, findings = found.unserved.result()
    wrong = [f for f in findings if f["subject"] == f"{NAMESPACE}/gravity"]
    assert code == 1 and len(wrong) == 1
    assert "imu_estimator to doctors_test" in wrong[0]["found"] and "reliab" in wrong[0]["found"].lower()


def test_every_node_has_the_topics_and_services_of_the_table(found):
    found.compared.result()
