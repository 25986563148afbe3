"""The running graph: its nodes have the topics and services of the table of nodes, and the doctor measures the graph."""

import functools
import importlib
import re
import time

import pytest

rclpy = pytest.importorskip("rclpy", reason="it looks at the running graph: ./gravcomp test")

from gravcomp.graph.nodes import NODES, node
from gravcomp.launcher import Graph
from gravcomp.launcher.domain import reserve_domain
from gravcomp.launcher.host_client import NodeHost
from gravcomp.launcher.robot_graph import LOOP, RobotGraph

pytestmark = [pytest.mark.rates, pytest.mark.timeout(600)]

# With a namespace, because nothing must depend on an empty one.
NAMESPACE = "/left"
DOMAIN = reserve_domain()
START = 300.0  # s; a machine that has never run the graph compiles first
# Ports of every node: those of rclpy, of the parameters and of the lifecycle.
COMMON_TOPICS = {"/rosout", "/parameter_events", "/clock"}
COMMON_SERVICES = ("rcl_interfaces/", "lifecycle_msgs/", "type_description_interfaces/")
RATED = {port.name: port.type for entry in NODES for port in entry.publishes if port.rate is not None}


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """The loop on a virtual robot, as processes."""
    from gravcomp.canbus.multicast import private_channel

    motion = {"motion": "topic", "truth_rate": 50.0, "feedback_rate": 125}
    graph = RobotGraph("article", "udp_multicast", private_channel(), NAMESPACE, {"virtual_robot": motion})
    specs = [*graph.loop(), graph.node("gravcomp_hw", "virtual_robot")]
    with Graph(specs, tmp_path_factory.mktemp("logs"), {"ROS_DOMAIN_ID": DOMAIN}, NodeHost()) as processes:
        processes.start()
        yield graph, processes


@pytest.fixture(scope="module")
def observer(robot):
    """A node that asks the middleware for the nodes and topics of the graph."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=int(DOMAIN))
    observer = rclpy.create_node("doctors_test", context=context)
    yield observer
    observer.destroy_node()
    rclpy.shutdown(context=context)


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


def test_the_doctor_finds_rates_delays_and_fitting_qos(gravcomp, robot, observer):
    _, processes = robot
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
        answer = gravcomp("doctor", "--graph", "--namespace", NAMESPACE, "--json", ROS_DOMAIN_ID=DOMAIN)
        found.update({f["subject"]: f for f in answer.json["findings"]})
        return all(0.7 * wanted < rate < 1.1 * wanted for rate, wanted in (rates(found[name]) for name in RATED))

    try:
        until(regular, "", processes, 120.0)
    except AssertionError:
        raise AssertionError(f"not at their rates: {found}") from None
    for name in RATED:
        rate, wanted = rates(found[name])
        assert "behind its IMU sample" in found[name]["found"], found[name]
        if abs(rate - wanted) != 0.05 * wanted:  # the rate is rounded, so that this one may be either
            assert (found[name]["level"] == "ok") == (abs(rate - wanted) < 0.05 * wanted), found[name]
    assert found["QoS"]["level"] == "ok"


def test_the_doctor_names_a_subscription_that_cannot_be_served(gravcomp, robot, observer):
    from geometry_msgs.msg import Vector3Stamped

    demanding = observer.create_subscription(Vector3Stamped, f"{NAMESPACE}/gravity", lambda _: None, 10)
    answer = gravcomp("doctor", "--graph", "--namespace", NAMESPACE, "--json", ROS_DOMAIN_ID=DOMAIN)
    observer.destroy_subscription(demanding)
    wrong = [f for f in answer.json["findings"] if f["subject"] == f"{NAMESPACE}/gravity"]
    assert answer.code == 1 and len(wrong) == 1
    assert "imu_estimator to doctors_test" in wrong[0]["found"] and "reliab" in wrong[0]["found"].lower()


def test_the_doctor_reports_that_nothing_runs(gravcomp):
    answer = gravcomp("doctor", "--graph", "--json", ROS_DOMAIN_ID=reserve_domain())
    assert answer.code == 1
    silent = {f["subject"] for f in answer.json["findings"] if f["found"] == "nothing is published"}
    assert silent == set(RATED)


def test_every_node_has_the_topics_and_services_of_the_table(robot, observer, tmp_path):
    from gravcomp.arm.description import expanded, shipped_xacro

    graph, processes = robot
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(expanded(shipped_xacro("seven_axis_arm.urdf.xacro")), encoding="utf-8")
    more = [
        graph.node("gravcomp_fem", "viewer", port=8860),
        graph.node("gravcomp_estimation", "arm_gravity", urdf=str(urdf)),
        graph.node("gravcomp_fem", "arm_player", urdf=str(urdf)),
        graph.node("gravcomp_hw", "judge", duration=3600.0),
    ]
    names = [executable for _, executable in LOOP] + ["virtual_robot"] + [spec.executable for spec in more]
    # They end with this test: another one would hear the arm's topics, and the judge ends by itself.
    with Graph(more, tmp_path / "logs", {"ROS_DOMAIN_ID": DOMAIN}) as added:
        added.start()
        for executable in names:
            until(functools.partial(is_there, observer, executable), f"no {executable}", added)
            try:
                # A node creates its last ports at its activation.
                until(functools.partial(fits_the_table, observer, executable), "", added, 60.0)
            except AssertionError:
                raise AssertionError(f"{executable} is not what the table says: {interface(observer, executable)}") from None
    processes.check()


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
