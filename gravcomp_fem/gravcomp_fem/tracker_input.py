"""The topic measured/tip of inverse_controller: passes measurements to the observer, and reports what becomes of them."""

from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.lifecycle import LifecycleNode
from rclpy.subscription import Subscription
from std_msgs.msg import Header

from gravcomp.description import Robot
from gravcomp.inverse import Target
from gravcomp.tip_observer import TipObserver, TipObserverOptions
from gravcomp_fem.conversion import seconds, vector_of
from gravcomp_fem.deformed import Deformed
from gravcomp_node import SENSOR


class TrackerInput:
    """Observer of the tip of `node`'s robot; base_frame: of its targets."""

    def __init__(self, node: LifecycleNode, robot: Robot, base_frame: str):
        self._node = node
        self._observer = TipObserver(robot, base_frame=base_frame)

    def begin(self, options: TipObserverOptions) -> None:
        """Forget what was measured, and begin with these options."""
        self._observer.configure(options)

    def subscription(self) -> Subscription:
        """Return a subscription to measured/tip; its owner destroys it."""
        return self._node.create_subscription(PoseStamped, "measured/tip", self._on_measured, SENSOR)

    def predict(self, deformed: Deformed) -> None:
        """Remember a shape of the model for the measurements that belong to it."""
        self._observer.predict(
            seconds(deformed.header),
            deformed.tip_position,
            deformed.tip_orientation,
            deformed.response,
            deformed.cable_tension,
            len(deformed.contact) > 0,
        )

    def corrected(self, target: Target, header: Header) -> Target:
        """Return the target that the model has to reach, for a deformation with this header."""
        return self._observer.corrected(target, seconds(header))

    def report(self) -> tuple[str, dict[str, Any]]:
        """Return what the user has to know, empty while all is well, and the values for /diagnostics."""
        tracker = self._observer.status(self._now())
        if not (tracker.used or tracker.refused):
            return "", {}
        return tracker.sentence, {
            "tracker": tracker.state.value,
            "tracker_offset_mm": ", ".join(f"{1e3 * v:.2f}" for v in tracker.offset),
            "tracker_used": tracker.used,
            "tracker_refused": tracker.refused,
            "tracker_restarts": tracker.restarts,
        }

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9

    def _on_measured(self, message: PoseStamped) -> None:
        now = self._now()
        before = self._observer.status(now).state
        self._observer.measure(seconds(message.header), now, message.header.frame_id, vector_of(message.pose.position))
        after = self._observer.status(now)
        if after.state == before:
            return
        log = self._node.get_logger()
        if after.sentence:
            log.warning(after.sentence)
        else:
            log.info(f"measured/tip: {after.state.value}")
