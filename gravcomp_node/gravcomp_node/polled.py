"""Subscriptions that are asked instead of calling: what has come when somebody wants it, at no cost until then.

A usual subscription wakes the process for each message, which costs an executor ten times more than taking it. A page of 20 Hz needs
one in five messages of a stream of 100 Hz, and whoever keeps a record needs them in time to be kept, not at once. This one leaves them to the
middleware, which keeps as many as the depth of its quality of service says and drops the older ones.
"""

from dataclasses import dataclass
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile


@dataclass(frozen=True)
class Received:
    """A message and when it was sent, ns of the system's clock; `number`: its place in its publisher's stream."""

    message: Any
    sent: int
    number: int


class Polled:
    """A topic that is asked for."""

    def __init__(self, node: LifecycleNode, kind: type, topic: str, qos: QoSProfile):
        self._node = node
        self._kind = kind
        self._subscription = node.create_subscription(kind, topic, _never_called, qos, callback_group=_NeverExecuted())
        self.last: Received | None = None

    def take(self) -> Received | None:
        """The newest of what has come since the last call; None when nothing has. `last` keeps it."""
        fresh = self.take_all()
        return fresh[-1] if fresh else None

    def take_all(self) -> list[Received]:
        """All that has come since the last call and was kept, oldest first."""
        fresh = []
        with self._subscription.handle:
            while (taken := self._subscription.handle.take_message(self._kind, False)) is not None:
                message, info = taken
                fresh.append(Received(message, info["source_timestamp"], info.get("publication_sequence_number") or 0))
        self.last = fresh[-1] if fresh else self.last
        return fresh

    def destroy(self) -> None:
        self._node.destroy_subscription(self._subscription)


class _NeverExecuted(CallbackGroup):
    """An executor does not even wait for what may not be executed."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass


def _never_called(_: Any) -> None:
    raise AssertionError("asked for, never called")
