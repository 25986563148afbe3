"""Subscribing to a sensor stream as reliably as it is offered.

Live sensors publish best effort: a late sample is worth less than the next one. A replayed recording is published reliably, and then
nothing may be lost, or the result would differ from one time to the next. QoS is fixed at creation, so the subscription is made anew
when the publishers that are there ask for the other kind.
"""

from collections.abc import Callable

from gravcomp_node.qos import SENSOR
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

# Every sample, in order, waiting for whoever is slower.
LOSSLESS = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_ALL)


class SensorStream:
    """One subscription; call `follow` now and then."""

    def __init__(self, node: Node, kind: type, topic: str, callback: Callable, reliability: str):
        """`reliability`: auto, best_effort or reliable. `reliable` tells how it is taken now."""
        self._node, self._kind, self._topic, self._callback = node, kind, topic, callback
        self._follows = reliability == "auto"
        self.reliable = reliability == "reliable"
        self._subscription = self._subscribe()

    def follow(self) -> None:
        """Look at the publishers; subscribe anew if they are of the other kind."""
        if not self._follows:
            return
        offered = [p.qos_profile.reliability for p in self._node.get_publishers_info_by_topic(self._subscription.topic_name)]
        reliable = bool(offered) and all(r == ReliabilityPolicy.RELIABLE for r in offered)
        if offered and reliable != self.reliable:
            self.reliable = reliable
            self.close()
            self._subscription = self._subscribe()

    def close(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self._subscription)

    def _subscribe(self):
        qos = LOSSLESS if self.reliable else SENSOR
        return self._node.create_subscription(self._kind, self._topic, self._callback, qos)
