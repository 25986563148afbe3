"""A subscription to a sensor stream with the reliability that its publishers offer.

Live sensors publish best effort, because a late sample is worth less than the next one. A replay is published reliably; no sample
must be lost, or the results of two replays would differ. The QoS of a subscription is fixed at creation, so the subscription is
created again when the publishers offer another reliability.
"""

from collections.abc import Callable

from gravcomp_node.qos import SENSOR
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

# Every sample in order; a slow subscriber delays the publisher.
LOSSLESS = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_ALL)


class SensorStream:
    """One subscription; call `follow` periodically.

    Attribute reliable: whether the current subscription is reliable.
    """

    def __init__(self, node: Node, kind: type, topic: str, callback: Callable, reliability: str, *, raw: bool = False):
        """Subscribe to `topic`; `reliability`: auto, best_effort or reliable; raw: the callback takes serialised messages."""
        self._node, self._kind, self._topic, self._callback, self._raw = node, kind, topic, callback, raw
        self._follows = reliability == "auto"
        self.reliable = reliability == "reliable"
        self._subscription = self._subscribe()

    def follow(self) -> None:
        """Check the publishers; subscribe again if they offer another reliability."""
        if not self._follows:
            return
        offered = [p.qos_profile.reliability for p in self._node.get_publishers_info_by_topic(self._subscription.topic_name)]
        reliable = bool(offered) and all(r == ReliabilityPolicy.RELIABLE for r in offered)
        if offered and reliable != self.reliable:
            self.reliable = reliable
            self.close()
            self._subscription = self._subscribe()

    def close(self) -> None:
        """Destroy the subscription."""
        self._node.destroy_subscription(self._subscription)

    def _subscribe(self) -> Subscription:
        qos = LOSSLESS if self.reliable else SENSOR
        # Without overrides by parameters, which would fix the reliability that it follows.
        none = QoSOverridingOptions([])
        return self._node.create_subscription(
            self._kind, self._topic, self._callback, qos, qos_overriding_options=none, raw=self._raw
        )
