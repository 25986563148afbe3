"""Faults of CAN frames in one direction: lost, late, corrupted, doubled, reordered or renamed frames."""

import heapq

import can
import numpy as np

from gravcomp.canbus import c610
from gravcomp.canbus.codec import layouts
from gravcomp.description.hardware import MOTOR_IDS
from gravcomp.virtual.faults import FRAME_GROUPS, FRAME_KINDS, Fault


class FrameFaults:
    """Applies faults to the frames of one direction; keeps the frames that are late."""

    def __init__(self, random: np.random.Generator):
        self._random = random
        self._late: list[tuple[float, int, can.Message]] = []
        self._held: can.Message | None = None
        self._count = 0

    def through(self, frames: list[can.Message], now: float, faults: list[tuple[Fault, int | None]]) -> list[can.Message]:
        """Return the frames that arrive by `now` (s), earlier delayed ones included.

        Each fault comes with the frame id of its motor's feedback, None where it names no motor.
        """
        if not faults and not self._late and self._held is None:
            return frames
        if any(fault.kind == "bus_off" for fault, _ in faults):
            self._late.clear()
            self._held = None
            return []
        arrived = []
        while self._late and self._late[0][0] <= now:
            arrived.append(heapq.heappop(self._late)[2])
        for frame in frames:
            arrived += self._one(frame, now, faults)
        if self._held is not None and not any(fault.kind == "reorder" for fault, _ in faults):
            arrived.append(self._held)
            self._held = None
        return arrived

    def _one(self, frame: can.Message, now: float, faults: list[tuple[Fault, int | None]]) -> list[can.Message]:
        result = [frame]
        for fault, feedback_id in faults:
            if (
                fault.kind not in FRAME_KINDS
                or not _concerns(fault, feedback_id, frame)
                or self._random.random() >= fault.probability
            ):
                continue
            if fault.kind == "drop":
                return []
            if fault.kind == "delay":
                self._count += 1
                heapq.heappush(self._late, (now + fault.delay, self._count, frame))
                return []
            if fault.kind == "duplicate":
                result = [frame, frame]
            elif fault.kind == "corrupt":
                result = [self._corrupted(frame)]
            elif fault.kind == "wrong_id":
                result = [_renamed(frame)]
            elif fault.kind == "reorder":
                if self._held is None:
                    self._held = frame
                    return []
                result, self._held = [frame, self._held], None
        return result

    def _corrupted(self, frame: can.Message) -> can.Message:
        data = bytearray(frame.data)
        if data:
            data[int(self._random.integers(len(data)))] ^= int(self._random.integers(1, 256))
        return _copy(frame, frame.arbitration_id, data)


def _concerns(fault: Fault, feedback_id: int | None, frame: can.Message) -> bool:
    if feedback_id is not None:
        return frame.arbitration_id == feedback_id
    if fault.frames == "all":
        return True
    layout = layouts().get(frame.arbitration_id)
    return layout is not None and layout.name in FRAME_GROUPS[fault.frames]


def _renamed(frame: can.Message) -> can.Message:
    """Return the frame as if the id of the next motor had been set on the speed controller."""
    identifier = frame.arbitration_id
    motor = c610.motor_of(identifier)
    return _copy(frame, identifier ^ 1 if motor in (None, MOTOR_IDS[-1]) else identifier + 1, frame.data)


def _copy(frame: can.Message, identifier: int, data: bytes | bytearray) -> can.Message:
    return can.Message(
        timestamp=frame.timestamp, arbitration_id=identifier, is_extended_id=False, data=bytes(data), channel=frame.channel
    )
