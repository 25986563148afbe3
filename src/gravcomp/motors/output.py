"""The last clamp: the only module that makes frames with motor currents (`c610.command`).

A current that is not finite becomes zero, every other is clamped to the limit, and ids without a motor get zero, whatever the
callers computed.
"""

import math
from collections.abc import Sequence

import can

from gravcomp.canbus import c610
from gravcomp.description.hardware import Hardware


class CurrentOutput:
    """Makes the frames for the motors with the CAN ids `can_ids`; every current is within +-`limit` (A)."""

    def __init__(self, can_ids: Sequence[int], limit: float):
        self._can_ids, self._limit = tuple(can_ids), min(abs(limit), c610.LARGEST_CURRENT) if math.isfinite(limit) else 0.0
        self._frames = [name for name, ids in c610.COMMANDS.items() if any(i in ids for i in self._can_ids)]

    def frames(self, currents: Sequence[float], *, enabled: bool) -> list[can.Message]:
        """Return one frame per group of ids that has a motor, from the currents (A) in the order of `can_ids`.

        All currents are zero unless `enabled`.
        """
        safe = {can_id: self._clamp(current) for can_id, current in zip(self._can_ids, currents)} if enabled else {}
        return [c610.command(name, safe) for name in self._frames]

    def zero(self) -> list[can.Message]:
        """Return the frames with zero current."""
        return self.frames((), enabled=False)

    def _clamp(self, current: float) -> float:
        if not math.isfinite(current):
            return 0.0
        # A whole number of counts, so that rounding cannot exceed the limit.
        limit = math.floor(self._limit * c610.COUNTS_PER_AMPERE) / c610.COUNTS_PER_AMPERE
        return min(max(float(current), -limit), limit)


class BusOutputs:
    """The clamps of all buses of the hardware; frames carry the name of their bus in `channel` where there are several."""

    def __init__(self, hardware: Hardware):
        self._parts = []
        for index, bus in enumerate(hardware.all_buses):
            own = [i for i, motor in enumerate(hardware.motors) if hardware.bus_index(motor) == index]
            output = CurrentOutput([hardware.motors[i].can_id for i in own], hardware.drive.current_limit)
            self._parts.append((bus.name or None, own, output))

    def frames(self, currents: Sequence[float], *, enabled: bool) -> list[can.Message]:
        """Return the frames for all buses from the currents (A) in the order of the motors; zero unless `enabled`."""
        result = []
        for name, own, output in self._parts:
            for frame in output.frames([currents[i] for i in own] if enabled else (), enabled=enabled):
                frame.channel = name
                result.append(frame)
        return result

    def zero(self) -> list[can.Message]:
        """Return the frames with zero current."""
        return self.frames((), enabled=False)
