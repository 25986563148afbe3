"""Topics between the nodes of one process: a message goes from publisher to subscription as the object that it is.

The nodes of a process share one `LocalTopics`. A subscription receives locally as long as all publishers of its topic are in the
process and their quality of service fits its own; nothing is serialised for it then. When a publisher elsewhere appears, the
subscription receives everything from the middleware, until that publisher has gone (`follow`). The middleware gets a message when
somebody receives from it. Publishers and subscriptions stay visible to other processes in either case.

A publisher may also publish an `Adapted` value (type adaptation as in REP-2007): a subscription of the process that takes values
gets it as it is. The message is made only when somebody else receives it.

Who publishes a message leaves it to its receivers, and does not change it afterwards. A receiver's callback is called while the
publisher publishes; where the receiver's node is itself publishing, its message waits until the executor comes to it.
"""

import collections
import dataclasses
import functools
import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription

FOLLOW_PERIOD = 0.5
"""s between two looks for publishers in other processes."""


class Adapted:
    """A value to publish. `to_message` makes the message from it; `to_bytes`, if given, the bytes that the middleware gets."""

    def __init__(self, value: Any, to_message: Callable[[Any], Any], to_bytes: Callable[[Any], bytes] | None = None):
        self.value, self._to_message, self._to_bytes = value, to_message, to_bytes

    @functools.cached_property
    def message(self) -> Any:
        """The message, made when it is first asked for."""
        return self._to_message(self.value)

    @property
    def sent(self) -> Any:
        """What the middleware gets: the message, or its bytes."""
        return self._to_bytes(self.value) if self._to_bytes is not None else self.message


@dataclasses.dataclass
class _Receiver:
    node: Node
    subscription: Subscription
    callback: Callable[[Any], None] | None  # None: it is polled
    takes: Callable[[Any], None] | None  # its callback for values
    is_local: bool = False
    kept: collections.deque = dataclasses.field(default_factory=collections.deque)  # of a polled one: message, ns, number


class LocalTopics:
    """The topics of a process. The executor that calls all callbacks, one at a time, sets these attributes.

    changed: called when subscriptions change between local and middleware; wake: called when a message waits; spins: callbacks
    may be called now.
    """

    def __init__(self) -> None:
        self.spins = False
        self.changed: Callable[[], None] = lambda: None
        self.wake: Callable[[], None] = lambda: None
        self._publishers: dict[str, list[LocalPublisher]] = collections.defaultdict(list)
        self._receivers: dict[str, list[_Receiver]] = collections.defaultdict(list)
        self._of: dict[int, _Receiver] = {}  # by the id of the subscription; rclpy asks the middleware for the name of its topic
        self._waiting: collections.deque[tuple[_Receiver, Callable[[Any], None], Any]] = collections.deque()
        self._publishing: list[Node] = []  # nodes that publish now, each one in a callback that the one before it called
        self._followed = 0.0

    def add_publisher(self, node: Node, publisher: "LocalPublisher") -> None:
        """Take a publisher of a node of this process."""
        publisher.local, publisher.node, publisher.receivers = self, node, self._receivers[publisher.topic_name]
        self._publishers[publisher.topic_name].append(publisher)
        self._decide(publisher.topic_name)

    def add_subscription(
        self,
        node: Node,
        subscription: Subscription,
        callback: Callable[[Any], None] | None,
        takes: Callable[[Any], None] | None = None,
    ) -> None:
        """Take a subscription of a node of this process; callback: None for a polled one; takes: its callback for values."""
        depth = subscription.qos_profile.depth if subscription.qos_profile.history == HistoryPolicy.KEEP_LAST else None
        receiver = _Receiver(node, subscription, callback, takes, kept=collections.deque(maxlen=depth))
        self._receivers[subscription.topic_name].append(receiver)
        self._of[id(subscription)] = receiver
        self._decide(subscription.topic_name)

    def remove(self, entity: Publisher | Subscription) -> None:
        """Forget a publisher or a subscription that is destroyed."""
        for publishers in self._publishers.values():
            publishers[:] = [publisher for publisher in publishers if publisher is not entity]
        for receivers in self._receivers.values():
            receivers[:] = [receiver for receiver in receivers if receiver.subscription is not entity]
        self._of.pop(id(entity), None)
        self._waiting = collections.deque(call for call in self._waiting if call[0].subscription is not entity)

    def is_local(self, subscription: Subscription) -> bool:
        """Whether a subscription receives locally now."""
        receiver = self._of.get(id(subscription))
        return receiver is not None and receiver.is_local

    def kept(self, subscription: Subscription) -> list[tuple[Any, int, int]]:
        """Return the messages that a polled subscription has received locally since the last call: message, ns, number."""
        receiver = self._of.get(id(subscription))
        if receiver is None:
            return []
        taken = list(receiver.kept)
        receiver.kept.clear()
        return taken

    def deliver(self, publisher: "LocalPublisher", message: Any, receivers: list[_Receiver]) -> None:
        """Hand a message or an `Adapted` value of a publisher to local receivers of its topic."""
        self._publishing.append(publisher.node)
        try:
            for receiver in receivers:
                if receiver.callback is None:
                    receiver.kept.append((message_of(message), time.time_ns(), publisher.count))
                    continue
                if receiver.takes is not None and isinstance(message, Adapted):
                    callback, taken = receiver.takes, message.value
                else:
                    callback, taken = receiver.callback, message_of(message)
                if self.spins and receiver.node not in self._publishing:
                    callback(taken)
                else:
                    self._waiting.append((receiver, callback, taken))
                    self.wake()
        finally:
            self._publishing.pop()

    @property
    def has_waiting(self) -> bool:
        """Whether messages wait for their callbacks."""
        return bool(self._waiting)

    def call_next(self) -> None:
        """Call the callback of the oldest message that waits, if there is one."""
        try:
            _, callback, taken = self._waiting.popleft()
        except IndexError:
            return
        callback(taken)

    def follow(self) -> None:
        """Look for publishers in other processes, every FOLLOW_PERIOD."""
        now = time.monotonic()
        if now - self._followed < FOLLOW_PERIOD:
            return
        self._followed = now
        for topic in self._receivers:
            self._decide(topic)

    def _decide(self, topic: str) -> None:
        own = self._publishers.get(topic, [])
        for receiver in self._receivers.get(topic, ()):
            local = bool(own) and receiver.node.count_publishers(topic) <= len(own)
            local = local and all(_fits(publisher, receiver.subscription) for publisher in own)
            if local == receiver.is_local:
                continue
            receiver.is_local = local
            if not local:  # what the middleware kept meanwhile has been received already
                with receiver.subscription.handle:
                    while receiver.subscription.handle.take_message(receiver.subscription.msg_type, True) is not None:
                        pass
            self.changed()


def message_of(message: Any) -> Any:
    """Return the message that an `Adapted` value becomes; a message is returned as it is."""
    return message.message if isinstance(message, Adapted) else message


def _sent(message: Any) -> Any:
    return message.sent if isinstance(message, Adapted) else message


def _fits(publisher: Publisher, subscription: Subscription) -> bool:
    offered, wanted = publisher.qos_profile, subscription.qos_profile
    compatible, _ = qos_check_compatible(offered, wanted)
    return compatible != QoSCompatibility.ERROR and wanted.durability != DurabilityPolicy.TRANSIENT_LOCAL


class LocalPublisher(Publisher):
    """A publisher whose messages go to the subscriptions of its process as objects. Attribute count: of messages."""

    local: LocalTopics | None = None
    node: Node
    receivers: list[_Receiver]
    count = 0

    def publish(self, message: Any) -> None:
        """Publish a message, or an `Adapted` value."""
        if self.local is None:
            super().publish(_sent(message))
            return
        self.count += 1
        # First to the middleware: the receivers here may take a while.
        latched = self.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL  # kept for those who subscribe later
        receivers = [receiver for receiver in self.receivers if receiver.is_local]
        if latched or self.get_subscription_count() > len(receivers):
            super().publish(_sent(message))
        if receivers:
            self.local.deliver(self, message, receivers)
