"""A lifecycle node with one frozen data class of parameters, which by default configures and activates itself."""

import copy
import gc
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from gravcomp.config import ConfigError, declared_parameters
from gravcomp.description import load_robot_file
from gravcomp.graph.parameters.shared import SharedParameters
from gravcomp_node import ros_parameters
from gravcomp_node.local_topics import LocalPublisher, LocalTopics
from gravcomp_node.polled import NeverExecuted

OK, WARN, ERROR = (bytes([level]) for level in (0, 1, 2))


class ManagedNode(LifecycleNode):
    """Base of all nodes. A subclass sets `name` and `parameters_class` and overrides the hooks it needs.

    `parameters`: the current values (frozen data class); `robot_file`: the robot file; `finished`: set it to end the process.
    """

    name: str
    parameters_class: type

    def __init__(self, local: LocalTopics | None = None) -> None:
        """local: topics between the nodes of this process, where there are several."""
        self.local = local
        self._steady: Clock | None = None
        self._is_made = False  # what rclpy creates for itself before is left to it
        super().__init__(self.name)
        self._is_made = True
        self.finished = False
        self.is_active = False
        self._is_configured = False
        self.failure: str | None = None
        shared = ros_parameters.declare(self, SharedParameters, {}, "defaults")
        self.autostart = shared.autostart
        self.robot_file = load_robot_file(shared.robot)
        section = self._own_section(self.robot_file.section("nodes"))
        self.parameters = ros_parameters.declare(
            self, self.parameters_class, section, f"{self.robot_file.source}: nodes.{self.name}"
        )
        self._own_keys = {leaf.key for leaf in declared_parameters(self.parameters_class)}
        ros_parameters.refuse_unknown_overrides(self, (SharedParameters, self.parameters_class))
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(self._apply_change)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._level, self._sentence, self._values = WARN, "not configured", {}
        self.create_timer(1.0, self._publish_diagnostics)

    # Hooks.

    def configure(self) -> None:
        """Create the node's resources, publishers included. Raise ConfigError to refuse the transition."""

    def activate(self) -> None:
        """Create subscriptions and timers. Raise ConfigError to refuse the transition."""

    def deactivate(self) -> None:
        """Destroy what `activate` created, and leave the hardware in a safe state."""

    def cleanup(self) -> None:
        """Release what `configure` created."""

    def check_parameters(self, new: Any) -> None:
        """Check a change beyond the declared ranges; raise ConfigError to refuse it."""

    def parameters_changed(self, old: Any, new: Any) -> None:
        """Apply a change; `self.parameters` already holds the new values."""

    # Called by subclasses and by `run`.

    def report(self, level: bytes, sentence: str, **values: Any) -> None:
        """Set the level, message and values that /diagnostics publishes from now on."""
        self._level, self._sentence, self._values = level, sentence, values

    def start(self, may_activate: Callable[[], bool] = lambda: True) -> None:
        """Configure and, if then `may_activate()`, activate; not without `autostart`.

        Raises ConfigError when the node refuses a transition.
        """
        if not self.autostart:
            return
        if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
            raise ConfigError(self.failure or "could not be started")
        if may_activate() and self.trigger_activate() != TransitionCallbackReturn.SUCCESS:
            raise ConfigError(self.failure or "could not be started")

    def shut_down(self) -> None:
        """Deactivate and clean up from any state. Logs exceptions instead of raising them."""
        for needed, step in ((self.is_active, self.deactivate), (self._is_configured, self.cleanup)):
            if needed:
                try:
                    step()
                except Exception as error:  # the remaining steps must still run
                    self.get_logger().error(f"error during shutdown: {error!r}")
        self.is_active = self._is_configured = False

    # Publishers, subscriptions and timers, whose quality of service may be overridden by parameters.

    def create_publisher(self, msg_type: type, topic: str, qos_profile: QoSProfile | int, **options: Any) -> Publisher:
        """Create a publisher, as rclpy does. Raises ConfigError for an override of its quality of service that is not allowed."""
        if not self._is_made:
            return super().create_publisher(msg_type, topic, qos_profile, **options)
        publisher = self._create(
            super().create_publisher, msg_type, topic, qos_profile, publisher_class=LocalPublisher, **options
        )
        if self.local is not None:
            self.local.add_publisher(self, publisher)
        return publisher

    def create_subscription(
        self,
        msg_type: type,
        topic: str,
        callback: Callable,
        qos_profile: QoSProfile | int,
        *,
        takes: Callable | None = None,
        **options: Any,
    ) -> Subscription:
        """Create a subscription, as rclpy does. Raises ConfigError for an override that is not allowed.

        takes: callback for the values that nodes of this process publish (gravcomp_node.local_topics.Adapted).
        """
        if not self._is_made:
            return super().create_subscription(msg_type, topic, callback, qos_profile, **options)
        subscription = self._create(super().create_subscription, msg_type, topic, callback, qos_profile, **options)
        if self.local is not None and not subscription.raw:
            polled = isinstance(subscription.callback_group, NeverExecuted)
            self.local.add_subscription(self, subscription, None if polled else callback, takes)
        return subscription

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Destroy a publisher."""
        if self.local is not None:
            self.local.remove(publisher)
        return super().destroy_publisher(publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Destroy a subscription."""
        if self.local is not None:
            self.local.remove(subscription)
        return super().destroy_subscription(subscription)

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable,
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Create a timer of the steady clock, unless another one is given: a node watches also when /clock has stopped."""
        self._steady = self._steady or Clock(clock_type=ClockType.STEADY_TIME)
        return super().create_timer(timer_period_sec, callback, callback_group, clock or self._steady, autostart)

    def _create(self, create: Callable, *arguments: Any, **options: Any) -> Any:
        *first, qos = arguments
        # A copy, because rclpy writes the overrides of a topic into the given profile.
        qos = QoSProfile(depth=qos) if isinstance(qos, int) else copy.copy(qos)
        options.setdefault("qos_overriding_options", QoSOverridingOptions.with_default_policies())
        try:
            return create(*first, qos, **options)
        except (RuntimeError, TypeError, InvalidQosOverridesError, InvalidParameterTypeException) as error:
            if "QoS override" not in str(error) and not isinstance(error, InvalidParameterTypeException):
                raise
            raise ConfigError(f"{self.get_name()}: {error}") from error

    def _warn_of_unused_overrides(self) -> None:
        for name in self._parameter_overrides:
            if name.startswith("qos_overrides.") and not self.has_parameter(name):
                self.get_logger().warning(f"parameter {name} overrides nothing: the node has no such publisher or subscription")

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `configure` and freeze the memory it allocated."""
        result = self._attempt(self.configure)
        self._is_configured = result == TransitionCallbackReturn.SUCCESS
        if self._is_configured:
            self.report(WARN, "configured, not active")
            _freeze_memory()
        return result

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `activate`."""
        super().on_activate(state)
        self.report(OK, "active")
        result = self._attempt(self.activate)
        self.is_active = result == TransitionCallbackReturn.SUCCESS
        if self.is_active:
            self._warn_of_unused_overrides()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `deactivate`."""
        self.is_active = False
        result = self._attempt(self.deactivate)
        super().on_deactivate(state)
        if result == TransitionCallbackReturn.SUCCESS:
            self.report(WARN, "not active")
        return result

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `cleanup`."""
        self._is_configured = False
        result = self._attempt(self.cleanup)
        if result == TransitionCallbackReturn.SUCCESS:
            self.report(WARN, "not configured")
        return result

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Run `shut_down`; succeeds from any state."""
        self.shut_down()
        self.report(WARN, "shut down: restart the process to use the node again")
        return TransitionCallbackReturn.SUCCESS

    def _attempt(self, step: Any) -> TransitionCallbackReturn:
        try:
            step()
        except (ConfigError, OSError) as error:
            self.failure = str(error)
            self.report(ERROR, self.failure)
            self.get_logger().error(self.failure)
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    # Parameters and diagnostics.

    def _own_section(self, sections: dict) -> dict:
        section = sections.get(self.name) or {}
        if not isinstance(section, dict):
            raise ConfigError(f"{self.robot_file.source}: nodes.{self.name} is {section!r}; a mapping of keys is needed")
        return section

    def _check_change(self, changes: list) -> SetParametersResult:
        if not self._are_own(changes):
            return SetParametersResult(successful=True)
        try:
            self.check_parameters(ros_parameters.read(self, self.parameters_class, changes))
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_change(self, changes: list) -> None:
        if not self._are_own(changes):
            return
        old, self.parameters = self.parameters, ros_parameters.read(self, self.parameters_class)
        if old != self.parameters:
            self.parameters_changed(old, self.parameters)

    def _are_own(self, changes: list) -> bool:
        """Return whether there are declared parameters among the changes: each override of a quality of service is one, too."""
        return any(change.name in self._own_keys for change in changes)

    def _publish_diagnostics(self) -> None:
        status = DiagnosticStatus(
            level=self._level,
            name=self.get_fully_qualified_name(),
            hardware_id=self.robot_file.robot.name,
            message=self._sentence,
            values=[KeyValue(key=k, value=str(v)) for k, v in self._values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


_frozen: list[bool] = []  # one entry for each time that this process froze its memory


def _freeze_memory() -> None:
    """Exclude existing objects (modules, compiled code, models) from garbage collection.

    The first full collection, a few seconds after the start, would block the node for 0.1 to 0.4 s.
    """
    if _frozen:  # what the node froze before may be garbage now; what its host froze is left alone, the collector would copy it
        gc.unfreeze()
    _frozen.append(True)
    gc.collect()
    gc.freeze()
