"""Observe a running graph for a few seconds and print the findings as JSON: rates, delays and compatibility of the QoS.

Started with `python -m gravcomp_hw.graph_probe` by `./gravcomp doctor --graph`; no executable is installed.
"""

import dataclasses
import importlib
import json
import sys
import time
from typing import Any

import rclpy
from gravcomp_node.polled import Polled
from rclpy.qos import QoSCompatibility, QoSProfile, ReliabilityPolicy, qos_check_compatible
from rclpy.time import Time

from gravcomp.doctor.finding import Finding
from gravcomp.graph.interface import Port
from gravcomp.graph.nodes import NODES

_QUIET, _LONGEST, _LISTEN = 1.0, 10.0, 4.0  # s
_PERIOD = 0.2  # s between two reads
_KEPT = QoSProfile(depth=500, reliability=ReliabilityPolicy.BEST_EFFORT)  # the messages of seconds: a busy machine reads late
_TOLERANCE = 0.05


class GraphProbe:
    """Measures every topic with a declared rate.

    It reads messages in batches and takes the time at which each was sent: on a busy machine a probe that is woken for each of
    some hundred messages a second loses most of them, and measures its own delay.
    """

    def __init__(self) -> None:
        self._node = rclpy.create_node("graph_probe")
        self._ages: dict[str, list[float]] = {}
        self._listened = _LISTEN  # s
        self._ports = {port.name: port for entry in NODES for port in entry.publishes if port.rate is not None}

    def examine(self) -> list[Finding]:
        """Return one finding per topic with a declared rate, and those about incompatible QoS."""
        topics = {name: Polled(self._node, _message_class(port.type), name, _KEPT) for name, port in self._ports.items()}
        self._discover(topics)
        begin = time.monotonic()
        for name, topic in topics.items():
            topic.take_all()
            self._ages[name] = []
        while (listened := time.monotonic() - begin) < _LISTEN:
            time.sleep(min(_PERIOD, _LISTEN - listened))
            for name, topic in topics.items():
                self._ages[name] += [1e-9 * (got.sent - _stamp_ns(got.message)) for got in topic.take_all()]
        self._listened = time.monotonic() - begin
        return [self._of_topic(port) for port in self._ports.values()] + self._quality()

    def _discover(self, topics: dict[str, Polled]) -> None:
        """Wait until no more publishers appear and each topic that has one has been received; a busy machine takes seconds."""
        begin = changed = time.monotonic()
        found: set[str] = set()
        heard: set[str] = set()
        while (now := time.monotonic()) - begin < _LONGEST:
            published = {name for name in topics if self._node.count_publishers(name)}
            heard |= {name for name, topic in topics.items() if topic.take_all()}
            if published != found:
                found, changed = published, now
            if found and found <= heard and now - changed > _QUIET:
                return
            time.sleep(_PERIOD)

    def _of_topic(self, port: Port) -> Finding:
        ages = sorted(self._ages[port.name])
        if not ages:
            return Finding("missing", port.name, "nothing is published", "./gravcomp up")
        rate = len(ages) / self._listened
        level = "ok" if abs(rate - port.rate) <= _TOLERANCE * port.rate else "optional"
        return Finding(
            level, port.name, f"{rate:.0f} Hz of {port.rate:.0f}, {1e3 * ages[len(ages) // 2]:.1f} ms behind its IMU sample"
        )

    def _quality(self) -> list[Finding]:
        findings = []
        for name, _ in self._node.get_topic_names_and_types():
            for publisher in self._node.get_publishers_info_by_topic(name):
                for subscriber in self._node.get_subscriptions_info_by_topic(name):
                    fits, reason = qos_check_compatible(publisher.qos_profile, subscriber.qos_profile)
                    if fits == QoSCompatibility.ERROR:
                        pair = f"{publisher.node_name} to {subscriber.node_name}: {reason}"
                        findings.append(Finding("missing", name, pair, "give both the same reliability and durability"))
        return findings or [Finding("ok", "QoS", "every subscription is compatible with its publishers")]


def _stamp_ns(message: Any) -> int:
    return Time.from_msg(message.header.stamp).nanoseconds


def _message_class(kind: str) -> type:
    package, _, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def main() -> int:
    """Print the findings; return the exit code."""
    rclpy.init()
    print(json.dumps([dataclasses.asdict(finding) for finding in GraphProbe().examine()]))
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
