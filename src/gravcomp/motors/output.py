"""The last clamp: the only module that encodes motor currents as frames.

A current that is not finite becomes zero, every other is clamped to the limit, and ids without a motor get zero, whatever the
callers computed.
"""

import math
from collections.abc import Sequence

import can

from gravcomp.canbus import codec

_FRAMES = {"MotorCommand1to4": range(1, 5), "MotorCommand5to8": range(5, 9)}


class CurrentOutput:
    """Makes the frames for the motors with the CAN ids `can_ids`; every current is within +-`limit` (A)."""

    def __init__(self, can_ids: Sequence[int], limit: float):
        self._can_ids, self._limit = tuple(can_ids), min(abs(limit), 10.0) if math.isfinite(limit) else 0.0
        self._frames = {name: ids for name, ids in _FRAMES.items() if any(i in ids for i in self._can_ids)}

    def frames(self, currents: Sequence[float], *, enabled: bool) -> list[can.Message]:
        """Return one frame per group of four ids that has a motor, from the currents (A) in the order of `can_ids`.

        All currents are zero unless `enabled`.
        """
        safe = dict.fromkeys(range(1, 9), 0.0)
        if enabled:
            safe.update({can_id: self._clamp(current) for can_id, current in zip(self._can_ids, currents)})
        return [codec.encode(name, **{f"current_{i}": safe[i] for i in ids}) for name, ids in self._frames.items()]

    def zero(self) -> list[can.Message]:
        """Return the frames with zero current."""
        return self.frames((), enabled=False)

    def _clamp(self, current: float) -> float:
        if not math.isfinite(current):
            return 0.0
        limit = math.floor(self._limit * 1000) / 1000  # a whole count of 1 mA, so that rounding cannot exceed the limit
        return min(max(float(current), -limit), limit)
