"""Node recorder: writes the graph's topics into a bag without decoding the messages.

It discovers topics while it runs, subscribes to each with the reliability that its publishers offer, and stores their QoS in
the bag.
"""

import importlib
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from gravcomp_node.managed_node import OK, WARN
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rosbags.interfaces import Connection, Qos

from gravcomp.config import ConfigError
from gravcomp.graph.parameters.recorder import RecorderParameters
from gravcomp.recordings.bags import BagError
from gravcomp.recordings.bags.qos import offered_qos
from gravcomp.recordings.bags.writing import BagWriter
from gravcomp_node import ManagedNode, run

_DISCOVERY_INTERVAL = 0.25  # s, between two searches for new topics
_DEPTH = 1000
_ANY = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=_DEPTH)  # compatible with every publisher
_GLOBAL = ("/tf", "/tf_static", "/clock", "/diagnostics", "/rosout", "/parameter_events")


class Recorder(ManagedNode):
    """Writes every topic of the graph into a bag."""

    name = "recorder"
    parameters_class = RecorderParameters

    def configure(self) -> None:
        """Create the bag. Raises ConfigError when no folder is given, BagError when it cannot be created."""
        if not self.parameters.out:
            raise ConfigError("recorder: the parameter out is empty; the folder of the new bag is needed")
        self._bag = BagWriter(Path(self.parameters.out), self.parameters.flush_interval)
        self._wanted = {self.resolve_topic_name(topic) for topic in self.parameters.topics}

    def activate(self) -> None:
        """Start to discover topics."""
        self._recorded: dict[str, _Recording] = {}
        self._refused: set[str] = set()
        self._discovery = self.create_timer(_DISCOVERY_INTERVAL, self._discover)
        self._discover()
        self.get_logger().info(f"recording into {self._bag.path}")

    def deactivate(self) -> None:
        """Unsubscribe from all topics."""
        self.destroy_timer(self._discovery)
        for recording in self._recorded.values():
            self.destroy_subscription(recording.subscription)

    def cleanup(self) -> None:
        """Close the bag."""
        if hasattr(self, "_bag"):
            self._bag.close()
            self.get_logger().info(f"{self._bag.messages} messages in {self._bag.path}")
            del self._bag

    def _discover(self) -> None:
        """Subscribe to new topics, and again to topics with changed QoS; write buffered messages to disk."""
        self._bag.flush()
        for topic, kinds in self.get_topic_names_and_types():
            if topic in self._refused or not self._belongs(topic):
                continue
            offers = [p.qos_profile for p in self.get_publishers_info_by_topic(topic)]
            if topic not in self._recorded:
                self._begin(topic, kinds, offers)
            elif offers and _matching(offers) != self._recorded[topic].qos:
                self._follow(self._recorded[topic], topic, offers)
        self.report(
            WARN if self._refused else OK, f"recording {len(self._recorded)} topics into {self._bag.path}",
            messages=self._bag.messages, refused=", ".join(sorted(self._refused)))  # fmt: skip

    def _belongs(self, topic: str) -> bool:
        if self._wanted:
            return topic in self._wanted
        own = self.get_namespace().rstrip("/") + "/"
        return topic.startswith(own) or topic in _GLOBAL

    def _begin(self, topic: str, kinds: list[str], offers: list[QoSProfile]) -> None:
        try:
            if len(kinds) != 1:
                raise BagError(f"it has several types: {', '.join(kinds)}")
            recording = _Recording(_message_class(kinds[0]), kinds[0])
            if offers:
                recording.connection = self._bag.add_topic(topic, kinds[0], [_stored(q) for q in offers])
        except (BagError, ImportError, AttributeError) as error:
            self._refused.add(topic)
            self.get_logger().warning(f"{topic} is not recorded: {error}")
            return
        self._recorded[topic] = recording
        self._follow(recording, topic, offers)

    def _follow(self, recording: "_Recording", topic: str, offers: list[QoSProfile]) -> None:
        if recording.subscription is not None:
            self.destroy_subscription(recording.subscription)
        # A topic without a publisher is subscribed as well, to record a publisher that sends one message and exits (`ros2 topic
        # pub --once`).
        recording.qos = _matching(offers) if offers else _ANY

        def write(message: bytes) -> None:
            if recording.connection is None:
                offered = [_stored(p.qos_profile) for p in self.get_publishers_info_by_topic(topic)]
                recording.connection = self._bag.add_topic(topic, recording.type_name, offered)
            self._bag.write(recording.connection, time.time_ns(), message)

        # Without overrides by parameters, which would fix what it follows.
        recording.subscription = self.create_subscription(
            recording.kind, topic, write, recording.qos, raw=True, qos_overriding_options=QoSOverridingOptions([])
        )


@dataclass
class _Recording:
    """A recorded topic."""

    kind: type
    type_name: str
    connection: Connection | None = None  # None until the topic has a publisher or a message
    qos: QoSProfile | None = None
    subscription: Subscription | None = None


def _matching(offers: list[QoSProfile]) -> QoSProfile:
    """Return the strongest QoS that all publishers offer."""
    reliable = all(q.reliability == ReliabilityPolicy.RELIABLE for q in offers)
    latched = all(q.durability == DurabilityPolicy.TRANSIENT_LOCAL for q in offers)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _stored(q: QoSProfile) -> Qos:
    return offered_qos(q.reliability.name, q.durability.name, q.history.name, q.depth)


def _message_class(name: str) -> type:
    package, _, message = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), message)


def main() -> int:
    """Run the node; return the exit code."""
    return run(Recorder)


if __name__ == "__main__":
    sys.exit(main())
