"""An executor for nodes that process streams of messages, with little overhead between a message and its callback.

It executes one node, or several of one process, between which messages go without the middleware (gravcomp_node.local_topics).

For every message, rclpy's executor collects all entities of the node again, creates a task with three coroutines, and lets the
middleware wait for about a dozen services. At 100 messages per second this costs several times as much as the callbacks. Here

    main thread    waits for subscriptions and timers only; its lists are rebuilt only when the node's entities change
    second thread  runs rclpy's executor for everything else. It sleeps until a service or client is ready. It checks the events
                   of the middleware only once per second, because a wait for the events of a subscription also ends for messages

Both threads hold the same lock while they call a callback, so callbacks run one at a time. A callback must not be a coroutine.
"""

import contextlib
import threading
from typing import Any

from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.event_handler import EventHandler
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from gravcomp_node.local_topics import LocalTopics

_EVENT_PERIOD = 1.0  # s between two checks for events of the middleware, such as incompatible quality of service


class StreamExecutor:
    """Executes the callbacks of nodes. Call `spin_once` from one thread only; it raises the exceptions of all callbacks.

    local: topics between the nodes.
    """

    def __init__(self, *nodes: Node, local: LocalTopics | None = None):
        self._nodes, self._context = nodes, nodes[0].context
        self._local = local
        self._serial = threading.RLock()
        self._guard = GuardCondition(callback=None, callback_group=None, context=self._context)
        self._rare = _RareExecutor(self)
        self._changed = True
        self._held = contextlib.ExitStack()  # keeps the handles of the lists alive while the wait set uses them
        self._subscriptions: dict[int, Subscription] = {}  # key: the pointer that the wait set returns
        self._timers: dict[int, Timer] = {}
        self._wait_set: Any = None
        self._error: BaseException | None = None
        self._ending = False
        for node in nodes:
            self._rare.add_node(node)
        if local is not None:
            local.changed, local.wake, local.spins = self.entities_changed, self._wake, True
        self._main: int | None = None  # thread that spins
        self._thread = threading.Thread(target=self._serve, name="services", daemon=True)
        self._thread.start()

    def spin_once(self, timeout: float) -> None:
        """Wait up to `timeout` (s) for messages and timers, and call their callbacks."""
        if self._error is not None:
            raise self._error
        self._main = threading.get_ident()
        self._call_local()
        with self._serial:
            if self._local is not None:
                self._local.follow()
            if self._changed:
                self._gather()
        wait_set = self._wait_set
        wait_set.clear_entities()
        for subscription in self._subscriptions.values():
            wait_set.add_subscription(subscription.handle)
        for timer in self._timers.values():
            wait_set.add_timer(timer.handle)
        wait_set.add_guard_condition(self._guard.handle)
        wait_set.wait(int(timeout * 1e9))
        for pointer in wait_set.get_ready_entities("timer"):
            self._call_timer(self._timers[pointer])
        for pointer in wait_set.get_ready_entities("subscription"):
            self._call_subscription(self._subscriptions[pointer])
            self._call_local()

    def shutdown(self) -> None:
        """Stop the second thread and release the node."""
        self._ending = True
        if self._local is not None:
            self._local.spins = False
        self._rare.wake()
        self._thread.join(5.0)
        self._rare.shutdown()
        self._held.close()
        self._guard.destroy()

    def entities_changed(self) -> None:
        """Rebuild the lists before the next wait, because the node's entities have changed. Callable from any thread."""
        self._changed = True
        self._trigger()

    def _gather(self) -> None:
        """Rebuild the lists, without what is polled (gravcomp_node.polled) or received locally."""
        self._changed = False
        self._held.close()
        self._subscriptions = self._hold(
            subscription
            for node in self._nodes
            for subscription in node.subscriptions
            if self._local is None or not self._local.is_local(subscription)
        )
        self._timers = self._hold(timer for node in self._nodes for timer in node.timers)
        self._wait_set = rclpy_implementation.WaitSet(
            len(self._subscriptions), 1, len(self._timers), 0, 0, 0, self._context.handle
        )

    def _hold(self, entities: Any) -> dict[int, Any]:
        held = {}
        for entity in entities:
            if entity.callback_group.can_execute(entity):
                with contextlib.suppress(InvalidHandle):
                    self._held.enter_context(entity.handle)
                    held[entity.handle.pointer] = entity
        return held

    def _call_timer(self, timer: Timer) -> None:
        with self._serial, contextlib.suppress(InvalidHandle):
            with timer.handle:
                if not timer.handle.is_timer_ready():  # cancelled, or called in the meantime
                    return
                timer.handle.call_timer()
            timer.callback()

    def _call_subscription(self, subscription: Subscription) -> None:
        with self._serial:
            if self._changed and not any(subscription in list(node.subscriptions) for node in self._nodes):
                return  # destroyed by a callback that ran before it
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return
            if subscription._callback_type is Subscription.CallbackType.MessageOnly:
                subscription.callback(taken[0])
            else:
                subscription.callback(*taken)

    def _call_local(self) -> None:
        """Call the callbacks of the messages that wait between nodes, and of those that they publish."""
        while self._local is not None and self._local.has_waiting:
            with self._serial:
                self._local.call_next()

    def _wake(self) -> None:
        """End the waiting, where another thread has published between nodes."""
        if threading.get_ident() != self._main:
            self._trigger()

    def _serve(self) -> None:
        """Body of the second thread."""
        try:
            while not self._ending:
                self._rare.takes_events = False
                self._serve_what_comes(_EVENT_PERIOD)
                self._rare.takes_events = True
                self._serve_what_comes(0.0)
        except (ShutdownException, ExternalShutdownException):
            return
        except BaseException as error:  # spin_once raises it in the main thread
            self._error = error
            self._trigger()

    def _serve_what_comes(self, timeout: float) -> None:
        """Call callbacks one after the other until none is ready within `timeout` (s)."""
        while not self._ending:
            try:
                handler, _, _ = self._rare.wait_for_ready_callbacks(timeout)
            except TimeoutException:
                return
            with self._serial:
                if not self._ending:
                    handler()
                    handler.result()

    def _trigger(self) -> None:
        with contextlib.suppress(InvalidHandle):
            self._guard.trigger()


class _RareExecutor(SingleThreadedExecutor):
    """rclpy's executor for services and events. The node is registered with it, so it is notified of every new entity."""

    def __init__(self, owner: StreamExecutor):
        super().__init__(context=owner._context)
        self._owner = owner
        self.takes_events = False

    def can_execute(self, entity: Any) -> bool:
        elsewhere = (Subscription, Timer) if self.takes_events else (Subscription, Timer, EventHandler)
        return not isinstance(entity, elsewhere) and super().can_execute(entity)

    def wake(self) -> None:
        self._owner.entities_changed()
        super().wake()
