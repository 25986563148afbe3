"""The fault campaign's process in the graph. It reads orders from standard input and prints events, one JSON object per line.

    {"do": "fault", "fault": {"kind": "drop", "frames": "imu"}}     publish on virtual/fault; "clear" ends all faults
    {"do": "call", "service": "can_bridge/stop"}                    call a std_srvs/Trigger service and print its answer
    {"do": "enable", "on": false}                                   call inverse_controller/enable
    {"do": "command", "displacement": [...], "count": 20}           publish on cable/command at 100 Hz
    {"do": "flood", "messages": 10000}                              publish hostile messages on every input of the graph
    {"do": "match"}                                                 wait until faults and commands have a subscriber and
                                                                    a state of the bridge has arrived
    {"do": "count"}                                                 print the number of commands since the start
    {"do": "displacement"}                                          print the cable displacements of cable/state

Printed are the answers, and {"event": "state", "time", "state", "message"} at every change of cable/state. Started with
`python -m gravcomp_hw.fault_probe`; no executable is installed, because only benchmarks and tests use it.
"""

import array
import json
import random
import sys
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, QuaternionStamped, Vector3Stamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, Temperature
from std_msgs.msg import Float32, String
from std_srvs.srv import SetBool, Trigger

from gravcomp.graph.parameters.fault_probe import FaultProbeParameters
from gravcomp_msgs.msg import CableCommand, CableState, Deformation, ShapeTarget
from gravcomp_node import COMMAND, SENSOR, ManagedNode, run

_WILD = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-308, 0.0, -1.0, 1.0, 0.03, 1e9)
_FLOODED = (
    (CableCommand, "cable/command", COMMAND),
    (Float32, "imu/heater", COMMAND),
    (Imu, "imu/data_raw", SENSOR),
    (Temperature, "imu/temperature", SENSOR),
    (Vector3Stamped, "gravity", SENSOR),
    (Deformation, "robot/deformation", SENSOR),
    (PoseStamped, "target", COMMAND),
    (ShapeTarget, "target/shape", COMMAND),
    (QuaternionStamped, "virtual/base_orientation", COMMAND),
    (String, "virtual/fault", QoSProfile(depth=20)),
)
_MATCH_TIMEOUT = 10.0  # s
_FLOOD_PAUSE = 5e-4  # s between two messages: about the rate that six nodes can process


class FaultProbe(ManagedNode):
    """Injects faults and hostile messages on request, and prints the bridge's states."""

    name = "fault_probe"
    parameters_class = FaultProbeParameters

    def configure(self) -> None:
        """Create publishers and clients."""
        self._random = random.Random(self.parameters.seed)
        self._commands, self._last_state, self._bridge_values, self._displacement = 0, None, {}, []
        self._state_time = 0.0
        self._outputs = {topic: self.create_publisher(kind, topic, qos) for kind, topic, qos in _FLOODED}
        self._trigger_clients = {}
        self._enable = self.create_client(SetBool, "inverse_controller/enable")

    def activate(self) -> None:
        """Create subscriptions and start reading orders."""
        self._inputs = [
            self.create_subscription(CableState, "cable/state", self._on_state, COMMAND),
            self.create_subscription(CableCommand, "cable/command", self._on_command, QoSProfile(depth=1000)),
            self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50),
        ]
        threading.Thread(target=self._execute_orders, name="orders", daemon=True).start()
        _print(event="ready")

    def _execute_orders(self) -> None:
        orders = {
            "fault": self._fault, "call": self._call, "enable": self._set_enabled, "command": self._command,
            "flood": self._flood, "match": self._match, "count": self._count, "displacement": self._print_displacement,
        }  # fmt: skip
        for line in sys.stdin:
            order = json.loads(line)
            orders[order.pop("do")](**order)
        self.finished = True

    def _fault(self, fault: dict | str) -> None:
        self._outputs["virtual/fault"].publish(String(data=fault if isinstance(fault, str) else json.dumps(fault)))

    def _call(self, service: str) -> None:
        if service not in self._trigger_clients:
            self._trigger_clients[service] = self.create_client(Trigger, service)
        client = self._trigger_clients[service]
        if not client.wait_for_service(2.0):
            _print(event="answer", service=service, success=False, message="no such service")
            return
        sent = time.time()
        future = client.call_async(Trigger.Request())
        future.add_done_callback(
            lambda f: _print(event="answer", service=service, sent=sent, success=f.result().success, message=f.result().message)
        )

    def _set_enabled(self, on: bool) -> None:
        """Call the service until it answers.

        A restarted controller does not receive calls immediately, while the service of its killed predecessor is still listed.
        """
        end, done = time.monotonic() + _MATCH_TIMEOUT, False
        while not done and time.monotonic() < end:
            if self._enable.wait_for_service(1.0):
                answered = threading.Event()
                self._enable.call_async(SetBool.Request(data=on)).add_done_callback(lambda _, answered=answered: answered.set())
                done = answered.wait(1.0)
        _print(event="enabled", on=on, success=done)

    def _command(self, displacement: list[float], count: int = 1) -> None:
        for _ in range(count):
            self._outputs["cable/command"].publish(CableCommand(displacement=array.array("d", displacement)))
            time.sleep(0.01)

    def _flood(self, messages: int) -> None:
        for _ in range(messages):
            kind, topic, _ = self._random.choice(_FLOODED)
            self._outputs[topic].publish(self._hostile(kind()))
            time.sleep(_FLOOD_PAUSE)
        _print(event="flooded", messages=messages)

    def _hostile(self, message: object) -> object:
        """Return the message with every field filled with hostile values."""
        for name, kind in message.get_fields_and_field_types().items():
            setattr(message, name, self._hostile_value(kind, getattr(message, name)))
        return message

    def _hostile_value(self, kind: str, value: object) -> object:
        chance = self._random
        if kind in ("double", "float"):
            number = chance.choice(_WILD)
            return number if kind == "double" or abs(number) < 3e38 or number != number else 3e38
        if kind == "sequence<double>":
            return array.array("d", (chance.choice(_WILD) for _ in range(chance.choice((0, 1, 5, 6, 6, 6, 7, 300)))))
        if kind == "string":
            return chance.choice(("", "soft_base", "x" * 1000, "{kind: drop", "null", "[1, 2]", "{kind: 3}", "\u2603"))
        if kind == "boolean":
            return chance.random() < 0.5
        if kind.startswith(("uint", "int")):
            return chance.choice((0, 1, 127))
        if hasattr(value, "get_fields_and_field_types"):
            return self._hostile(value)
        return value

    def _match(self) -> None:
        """Wait until the middleware has connected this process with the robot and with the bridge.

        Messages sent earlier are lost, and so are the states of a restarted bridge.
        """
        begin = time.monotonic()
        needed = [self._outputs[topic] for topic in ("virtual/fault", "cable/command")]
        matched = False
        while not matched and time.monotonic() < begin + _MATCH_TIMEOUT:
            time.sleep(0.01)
            matched = self._state_time > begin and all(output.get_subscription_count() for output in needed)
        _print(event="matched", success=matched)

    def _count(self) -> None:
        _print(event="count", commands=self._commands, bridge=self._bridge_values)

    def _print_displacement(self) -> None:
        _print(event="displacement", displacement=self._displacement)

    def _on_state(self, message: CableState) -> None:
        self._displacement, self._state_time = list(message.displacement), time.monotonic()
        state = (message.state, message.message)
        if state != self._last_state:
            self._last_state = state
            _print(event="state", time=time.time(), state=message.state, message=message.message)

    def _on_command(self, _: CableCommand) -> None:
        self._commands += 1

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self.get_namespace().rstrip('/')}/can_bridge":
                self._bridge_values = {value.key: value.value for value in status.values}


def _print(**what: object) -> None:
    print(json.dumps(what), flush=True)


def main() -> int:
    """Run the probe; return the exit code."""
    return run(FaultProbe)


if __name__ == "__main__":
    sys.exit(main())
