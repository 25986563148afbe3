"""The last clamp before the controller of a ros2_control robot: what leaves is finite and within the limits."""

import math
from collections.abc import Sequence

from gravcomp.motors.joint_states import JointStates


class JointOutput:
    """Clamps angles (rad) or, `by_effort`, efforts (N m) of the joints of `states`, whatever was computed."""

    def __init__(self, states: JointStates, *, by_effort: bool):
        self._states, self._by_effort = states, by_effort
        self._last: list[float | None] = [None] * len(states.motors)

    def clamp(self, values: Sequence[float]) -> list[float] | None:
        """Return the values (rad or N m) within their limits; None where an angle is not a number and none was sent before."""
        result = []
        for i, value in enumerate(values):
            low, high = self._range(i)
            if not math.isfinite(value):
                before = 0.0 if self._by_effort else self._last[i]
                if before is None:
                    return None
                value = before
            result.append(min(max(value, low), high))
        self._last = list(result)
        return result

    def _range(self, index: int) -> tuple[float, float]:
        scale = self._states.scales[index]
        if self._by_effort:
            largest = scale.drive.current_limit * scale.drive.torque_constant
            return -largest, largest
        ends = sorted(scale.angle(x) for x in scale.limits())
        return ends[0], ends[1]
