"""An executor for nodes that follow streams of messages: little work between a message and its callback.

rclpy's own gathers all entities of a node anew for every message, makes a task with three coroutines of it, and lets the middleware
wait for a dozen services each time; at a hundred messages a second that costs several times what our callbacks do. Here

    main thread    waits for subscriptions and timers alone, with lists made anew only when the node's entities change
    second thread  rclpy's executor for everything else: asleep until a service or client has something; it looks at the events
                   of the middleware once a second, since whoever waits for those of a subscription is woken by its messages, too

Callbacks of both are run one at a time, as by a single thread: whoever calls one holds the same lock. No callback may be a coroutine.
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

_EVENT_PERIOD = 1.0  # s between two looks at events of the middleware, such as a quality of service that does not fit


class StreamExecutor:
    """Spins one node. `spin_once` is called from one thread only; an exception of any callback is raised there."""

    def __init__(self, node: Node):
        self._node, self._context = node, node.context
        self._serial = threading.RLock()
        self._guard = GuardCondition(callback=None, callback_group=None, context=node.context)
        self._rare = _RareExecutor(self)
        self._changed = True
        self._held = contextlib.ExitStack()  # the handles of the lists, so that none is destroyed while it is waited for
        self._subscriptions: dict[int, Subscription] = {}  # by the pointers that a wait answers with
        self._timers: dict[int, Timer] = {}
        self._wait_set: Any = None
        self._error: BaseException | None = None
        self._ending = False
        self._rare.add_node(node)
        self._thread = threading.Thread(target=self._serve, name="services", daemon=True)
        self._thread.start()

    def spin_once(self, timeout: float) -> None:
        """Wait up to `timeout` (s) for messages and timers, and call what is due."""
        if self._error is not None:
            raise self._error
        with self._serial:
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

    def shutdown(self) -> None:
        """End the second thread and let go of the node."""
        self._ending = True
        self._rare.wake()
        self._thread.join(5.0)
        self._rare.shutdown()
        self._held.close()
        self._guard.destroy()

    def entities_changed(self) -> None:
        """The node has got or lost an entity; from any thread."""
        self._changed = True
        self._trigger()

    def _gather(self) -> None:
        """The lists anew. Entities whose group executes nothing (gravcomp_node.polled) are not waited for."""
        self._changed = False
        self._held.close()
        self._subscriptions = self._hold(self._node.subscriptions)
        self._timers = self._hold(self._node.timers)
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
                if not timer.handle.is_timer_ready():  # cancelled, or served meanwhile
                    return
                timer.handle.call_timer()
            timer.callback()

    def _call_subscription(self, subscription: Subscription) -> None:
        with self._serial:
            if self._changed and subscription not in list(self._node.subscriptions):
                return  # destroyed by a callback of this round
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return
            if subscription._callback_type is Subscription.CallbackType.MessageOnly:
                subscription.callback(taken[0])
            else:
                subscription.callback(*taken)

    def _serve(self) -> None:
        """The second thread."""
        try:
            while not self._ending:
                self._rare.takes_events = False
                self._serve_what_comes(_EVENT_PERIOD)
                self._rare.takes_events = True
                self._serve_what_comes(0.0)
        except (ShutdownException, ExternalShutdownException):
            return
        except BaseException as error:  # raised where somebody sees it
            self._error = error
            self._trigger()

    def _serve_what_comes(self, timeout: float) -> None:
        """One after the other, until nothing has come for `timeout` (s)."""
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
    """rclpy's executor of what comes rarely; the one that the node knows, so it hears of every new entity."""

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
