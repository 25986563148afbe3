"""A stand-in for the controllers of ros2_control: what they accept, and what they command.

    trajectory  joint_trajectory_controller: every joint named, points in strictly increasing time, no velocity at the end, the
                end not in the past; a new trajectory replaces the old one and begins at the measured angles, or, where the time
                of its first point is zero, at this point; linear between points that give positions only, cubic between those
                that give velocities as well; after the end the last point stays
    position    forward_command_controller with interface_name position: one value a joint, kept until the next message
    effort      the same with efforts

The rules are those of https://control.ros.org/jazzy (joint_trajectory_controller, forward_command_controller).
"""

import dataclasses
import math
from collections.abc import Sequence


@dataclasses.dataclass(frozen=True)
class TrajectoryPoint:
    """Angles (rad) and speeds (rad/s, may be empty) at a time (s) from the start."""

    positions: Sequence[float]
    velocities: Sequence[float]
    time: float


class JointController:
    """The controller of `names` (k). Attributes: accepted, refused (messages)."""

    def __init__(self, names: Sequence[str], command: str):
        """command: one of description.joint_motors.COMMANDS."""
        self.names, self.command = tuple(names), command
        self.accepted = self.refused = 0
        self._points: list[TrajectoryPoint] = []
        self._begin = 0.0
        self._values: list[float] | None = None

    def on_trajectory(
        self, names: Sequence[str], points: Sequence[TrajectoryPoint], start: float | None, now: float, measured: Sequence[float]
    ) -> str | None:
        """Take a trajectory that starts at `start` (s; None: now) from the `measured` angles (k,) in rad.

        Return None, or why it is refused.
        """
        reason = self._objection(names, points, start, now)
        if reason is not None:
            self.refused += 1
            return reason
        order = [list(names).index(name) for name in self.names]
        self._begin = now if start is None else start
        self._points = [
            TrajectoryPoint(
                [p.positions[i] for i in order], [p.velocities[i] for i in order] if len(p.velocities) else [], p.time
            )
            for p in points
        ]
        if points[0].time > 0.0:
            self._points.insert(0, TrajectoryPoint(list(measured), [0.0] * len(order) if self._points[0].velocities else [], 0.0))
        self.accepted += 1
        return None

    def on_values(self, values: Sequence[float]) -> str | None:
        """Take positions or efforts (k,). Return None, or why they are refused."""
        if len(values) != len(self.names):
            self.refused += 1
            return f"{len(values)} values for {len(self.names)} joints"
        self._values = list(values)
        self.accepted += 1
        return None

    def wanted(self, now: float) -> list[float] | None:
        """Return what the hardware is commanded: angles (rad) or efforts (N m); None before the first message."""
        if self.command != "trajectory":
            return self._values
        if not self._points:
            return None
        since = max(now - self._begin, 0.0)  # until it starts, the joints stay where they are
        before, after = self._points[0], self._points[0]
        for point in self._points:
            before, after = after, point
            if point.time >= since:
                break
        if since >= after.time:
            return list(after.positions)
        share = max(since - before.time, 0.0) / (after.time - before.time)
        return [
            _between(before, after, i, share) if before.velocities and after.velocities else x + share * (y - x)
            for i, (x, y) in enumerate(zip(before.positions, after.positions))
        ]

    def _objection(self, names: Sequence[str], points: Sequence[TrajectoryPoint], start: float | None, now: float) -> str | None:
        if sorted(names) != sorted(self.names):
            return f"the joints {', '.join(names) or 'none'} are not those of the controller: {', '.join(self.names)}"
        if not points:
            return "the trajectory is empty"
        if any(abs(v) > 1e-7 for v in points[-1].velocities):
            return "the velocity of the last point is not zero"
        if start is not None and start + points[-1].time < now:
            return "it ends in the past"
        if any(after.time <= before.time for before, after in zip(points, points[1:])):
            return "the time between points is not strictly increasing"
        for point in points:
            if len(point.positions) != len(names) or len(point.velocities) not in (0, len(names)):
                return f"a point has {len(point.positions)} positions for {len(names)} joints"
            if not all(map(math.isfinite, point.positions)):
                return "a position is not a number"
        return None


def _between(before: TrajectoryPoint, after: TrajectoryPoint, joint: int, share: float) -> float:
    """Return the angle of a joint on the cubic between two points."""
    length = after.time - before.time
    x, y = before.positions[joint], after.positions[joint]
    v, w = before.velocities[joint] * length, after.velocities[joint] * length
    s = share
    return (2 * s**3 - 3 * s**2 + 1) * x + (s**3 - 2 * s**2 + s) * v + (3 * s**2 - 2 * s**3) * y + (s**3 - s**2) * w
