"""Subscriptions that are read when needed, without a callback and at no cost between two reads.

A usual subscription wakes the process for each message, which costs the executor ten times as much as taking the message. A page
with 20 updates per second needs only one in five messages of a 100 Hz stream, and a recorder can read messages in batches. A
polled subscription leaves the messages in the middleware, which keeps as many as the depth of the quality of service and drops
older ones.
"""

from dataclasses import dataclass
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile

from gravcomp_node.local_topics import LocalTopics


@dataclass(frozen=True)
class Received:
    """A message with the time at which it was sent (ns, system clock) and its sequence number at its publisher."""

    message: Any
    sent: int
    number: int


class Polled:
    """A polled subscription of `node` to a topic."""

    def __init__(self, node: LifecycleNode, kind: type, topic: str, qos: QoSProfile):
        self._node = node
        self._kind = kind
        self._local: LocalTopics | None = getattr(node, "local", None)
        self._subscription = node.create_subscription(kind, topic, _never_called, qos, callback_group=NeverExecuted())
        self.last: Received | None = None

    def take(self) -> Received | None:
        """Return the newest message since the last call, or None. `last` keeps it."""
        fresh = self.take_all()
        return fresh[-1] if fresh else None

    def take_all(self) -> list[Received]:
        """Return all messages kept since the last call, oldest first."""
        fresh = []
        if self._local is not None:
            fresh = [Received(*taken) for taken in self._local.kept(self._subscription)]
            if self._local.is_local(self._subscription):
                self.last = fresh[-1] if fresh else self.last
                return fresh
        with self._subscription.handle:
            while (taken := self._subscription.handle.take_message(self._kind, False)) is not None:
                message, info = taken
                fresh.append(Received(message, info["source_timestamp"], info.get("publication_sequence_number") or 0))
        self.last = fresh[-1] if fresh else self.last
        return fresh

    def destroy(self) -> None:
        """Destroy the subscription."""
        self._node.destroy_subscription(self._subscription)


class NeverExecuted(CallbackGroup):
    """A group whose entities are never executed, so that an executor does not wait for them."""

    def can_execute(self, entity: Any) -> bool:
        """Return False, for any entity."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Return False, for any entity."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Do nothing: none has begun."""


def _never_called(_: Any) -> None:
    raise AssertionError("a polled subscription has no callback")
