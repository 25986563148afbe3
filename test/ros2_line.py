"""Run a `ros2 ...` line of the documents: by the command itself if it is installed, else by the same calls of rclpy.

The wheels of ROS 2 have no command line. The calls here are those of ros2cli: the services of a node for parameters and
lifecycle, a message made from YAML for `topic pub` and `service call`, one message for `topic echo`, a count for `topic hz`.
"""

import importlib
import shlex
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import rclpy
import yaml
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from gravcomp.launcher.node_process import ACTIVE_FILE, find_executable

PATIENCE = 180.0  # s; events, which a machine that others load delays
_HEARD = 1.0  # s that `topic hz` listens


class Ros2:
    """Runs lines against the graph in the domain of this process. A line that fails raises AssertionError."""

    def __init__(self) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("ros2_line", context=self._context)
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def close(self) -> None:
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def run(self, line: str) -> str:
        """Return what the line prints."""
        if shutil.which("ros2"):
            endless = line.startswith(("ros2 topic hz", "ros2 topic echo"))
            words = ["timeout", "--signal=INT", "15", *shlex.split(line)] if endless else shlex.split(line)
            done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)
            assert done.returncode == 0 or endless, done.stderr
            return done.stdout
        match shlex.split(line)[1:]:
            case ["service", "call", name, kind, *content]:
                return str(self._call(kind, name, *content))
            case ["topic", "pub", "--once", name, kind, content]:
                return self._publish(kind, name, content)
            case ["topic", "hz", name]:
                return f"average rate: {self._rate(name):.3f}"
            case ["topic", "echo", name, "--field", field]:
                return str(getattr(self._one(name), field))
            case ["param", "set", node, name, value]:
                return self._set(node, name, yaml.safe_load(value))
            case ["param", "describe", node, name]:
                return str(
                    self.ask(
                        DescribeParameters, f"{node}/describe_parameters", DescribeParameters.Request(names=[name])
                    ).descriptors[0]
                )
            case ["lifecycle", "get", node]:
                return self.ask(GetState, f"{node}/get_state", GetState.Request()).current_state.label
            case ["lifecycle", "set", node, transition]:
                return self._change(node, transition)
        raise AssertionError(f"no replacement is known for: {line}")

    def state_of(self, node: str) -> str:
        return self.ask(GetState, f"{node}/get_state", GetState.Request()).current_state.label

    def listen(self, kind: type, topic: str, latched: bool = False) -> list:
        """Return a list to which the messages of a topic are appended while this node spins."""
        heard: list = []
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        reliability = ReliabilityPolicy.RELIABLE if latched else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=1 if latched else 100, durability=durability, reliability=reliability)
        self._node.create_subscription(kind, topic, heard.append, qos)
        return heard

    def subscribers(self, topic: str) -> set[str]:
        """Return the names of the nodes that subscribe to a topic."""
        return {found.node_name for found in self.subscriptions(topic)}

    def subscriptions(self, topic: str) -> list:
        """Return what the graph knows of the subscriptions of a topic."""
        return self._node.get_subscriptions_info_by_topic(topic)

    def names(self) -> list[str]:
        """Return the full names of the nodes in the graph.

        A node that has ended may stay among them: rmw takes a last report of its endpoints that comes after its end for a node.
        """
        return [f"{space.rstrip('/')}/{name}" for name, space in self._node.get_node_names_and_namespaces()]

    def _call(self, kind: str, name: str, content: str = "{}") -> object:
        service = _interface(kind)
        answer = self.ask(service, name, _filled(service.Request(), content))
        assert answer.success, answer.message
        return answer

    def ask(self, service: type, name: str, request: object) -> object:
        client = self._node.create_client(service, name)
        try:
            assert client.wait_for_service(PATIENCE), f"no node serves {name}"
            future = client.call_async(request)
            self._executor.spin_until_future_complete(future, PATIENCE)
            assert future.done(), f"no answer of {name}"
            return future.result()
        finally:
            self._node.destroy_client(client)

    def _publish(self, kind: str, name: str, content: str) -> str:
        message = _filled(_interface(kind)(), content)
        publisher = self._node.create_publisher(type(message), name, 10)
        # All that the graph knows: a message goes to those only that have found this publisher.
        known = lambda: len(self._node.get_subscriptions_info_by_topic(name))  # noqa: E731
        self.until(lambda: publisher.get_subscription_count() >= max(1, known()), f"no node subscribes to {name}")
        publisher.publish(message)
        # In short waits, so that other messages for this node are received as well.
        self.until(lambda: publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=0.01)), f"{name} is not acknowledged")
        self._node.destroy_publisher(publisher)
        return f"publishing #1: {message}"

    def _rate(self, name: str) -> float:
        times: list[float] = []
        self._listen(name, lambda _: times.append(time.monotonic()), lambda: times and time.monotonic() - times[0] > _HEARD)
        return (len(times) - 1) / (times[-1] - times[0])

    def _one(self, name: str) -> object:
        heard: list = []
        self._listen(name, heard.append, lambda: heard)
        return heard[-1]

    def _listen(self, name: str, callback, done) -> None:
        self.until(lambda: self._node.get_publishers_info_by_topic(name), f"no node publishes {name}")
        (offer,) = self._node.get_publishers_info_by_topic(name)
        latched = offer.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT, durability=durability)
        subscription = self._node.create_subscription(_interface(offer.topic_type), name, callback, qos)
        self.until(done, f"nothing came on {name}")
        self._node.destroy_subscription(subscription)

    def _set(self, node: str, name: str, value: float | str) -> str:
        if isinstance(value, str):
            given = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
        else:
            given = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=given)])
        (result,) = self.ask(SetParameters, f"{node}/set_parameters", request).results
        assert result.successful, result.reason
        return "Set parameter successful"

    def _change(self, node: str, label: str) -> str:
        transition = getattr(Transition, f"TRANSITION_{label.upper()}")
        assert self.ask(ChangeState, f"{node}/change_state", ChangeState.Request(transition=Transition(id=transition))).success
        return "Transitioning successful"

    def until(self, done, what: str, patience: float = PATIENCE) -> None:
        end = time.monotonic() + patience
        while not done():
            assert time.monotonic() < end, what
            self._executor.spin_once(0.05)


def run_node(line: str, environment: dict[str, str], *, interrupt: bool = False) -> tuple[int, str]:
    """Return exit code and output of a `ros2 run ...` line, which ends by itself, or by SIGINT as soon as the node is active."""
    _, run, package, executable, *arguments = shlex.split(line)
    assert run == "run"
    command = shlex.split(line) if shutil.which("ros2") else [find_executable(package, executable), *arguments]
    with tempfile.TemporaryDirectory() as folder:
        active, printed = Path(folder) / "active", Path(folder) / "printed"
        with printed.open("w", encoding="utf-8") as output:
            environment = {**environment, ACTIVE_FILE: str(active)}
            process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, env=environment)
        end = time.monotonic() + 2 * PATIENCE
        while process.poll() is None and not (interrupt and active.exists()):
            assert time.monotonic() < end, printed.read_text(encoding="utf-8")
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)  # nothing happens where the process has ended
        try:
            process.wait(PATIENCE)
        finally:
            process.kill()
        return process.returncode, printed.read_text(encoding="utf-8")


def _interface(kind: str) -> type:
    """Return the class of pkg/msg/Name or pkg/srv/Name."""
    package, folder, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.{folder}"), name)


def _filled(message: object, content: str) -> object:
    for field, value in yaml.safe_load(content).items():
        setattr(message, field, value)
    return message
