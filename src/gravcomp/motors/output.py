"""The last clamp: the only place from which motor currents become frames.

Whatever the layers above computed, a current that is not a number becomes zero, and none exceeds the motor's limit;
ids without a motor get zero. Nothing else in gravcomp encodes a motor command.
"""

import math
from collections.abc import Sequence

import can

from gravcomp.canbus import codec

_FRAMES = {"MotorCommand1to4": range(1, 5), "MotorCommand5to8": range(5, 9)}


class CurrentOutput:
    """Frames for the motors with the CAN ids `can_ids`, each within +-`limit` (A)."""

    def __init__(self, can_ids: Sequence[int], limit: float):
        self._can_ids, self._limit = tuple(can_ids), min(abs(limit), 10.0) if math.isfinite(limit) else 0.0
        self._frames = {name: ids for name, ids in _FRAMES.items() if any(i in ids for i in self._can_ids)}

    def frames(self, currents: Sequence[float], *, enabled: bool) -> list[can.Message]:
        """One frame for every group of four that has a motor; all zero unless `enabled`."""
        safe = dict.fromkeys(range(1, 9), 0.0)
        if enabled:
            safe.update({can_id: self._clamp(current) for can_id, current in zip(self._can_ids, currents)})
        return [codec.encode(name, **{f"current_{i}": safe[i] for i in ids}) for name, ids in self._frames.items()]

    def zero(self) -> list[can.Message]:
        """No current."""
        return self.frames((), enabled=False)

    def _clamp(self, current: float) -> float:
        if not math.isfinite(current):
            return 0.0
        limit = math.floor(self._limit * 1000) / 1000  # a whole count, so that rounding cannot pass the limit
        return min(max(float(current), -limit), limit)
