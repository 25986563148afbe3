"""Faults on request: what goes wrong on the bus, in the motors, the cables and the board.

A fault is data; `Fault.parse` reads it from a mapping such as `{kind: drop, frames: imu, probability: 0.3, duration: 2}`.
Faults of frames act in `FrameFaults`, the others where they belong (see robot.py). Everything random comes from one seeded
generator.
"""

import heapq
from dataclasses import dataclass
from typing import Any

import can
import numpy as np

from gravcomp.canbus.codec import layouts
from gravcomp.config import from_mapping, parameter

FRAME_KINDS = ("drop", "delay", "corrupt", "duplicate", "reorder", "wrong_id", "bus_off")
CABLE_KINDS = ("stall", "cable_break", "encoder_jump")
BOARD_KINDS = (
    "imu_stuck",
    "imu_saturated",
    "imu_invalid",
    "imu_silent",
    "heater_dead",
    "heater_stuck_on",
    "temperature_stuck",
    "board_restart",
)
KINDS = FRAME_KINDS + CABLE_KINDS + BOARD_KINDS

FRAME_GROUPS = {
    "imu": ("ImuAccelerometer", "ImuGyroscope", "ImuTime"),
    "feedback": tuple(f"MotorFeedback{i}" for i in range(1, 9)),
    "status": ("BoardStatus",),
    "command": ("MotorCommand1to4", "MotorCommand5to8"),
    "heater": ("HeaterCommand",),
}


@dataclass(frozen=True)
class Fault:
    """One fault, from the moment it is injected for `duration`."""

    kind: str = parameter(choices=KINDS, description="what goes wrong")
    duration: float = parameter(0.0, unit="s", minimum=0.0, maximum=1e6, description="how long; 0: until cleared")
    frames: str = parameter("all", choices=("all", *FRAME_GROUPS), description="which frames, for faults of frames")
    probability: float = parameter(1.0, minimum=0.0, maximum=1.0, description="for each frame, for faults of frames")
    delay: float = parameter(20.0, edge="ms", minimum=0.0, maximum=60000.0, description="for kind delay")
    cable: str = parameter("", description="which cable's motor; for wrong_id and drop of feedback, too; empty: all")

    @staticmethod
    def parse(mapping: Any, source: str) -> "Fault":
        """Raises ConfigError, naming what is allowed."""
        return from_mapping(Fault, mapping, source=source)


class FrameFaults:
    """What faults do to the frames of one direction."""

    def __init__(self, random: np.random.Generator):
        self._random = random
        self._late: list[tuple[float, int, can.Message]] = []
        self._held: can.Message | None = None
        self._count = 0

    def through(self, frames: list[can.Message], now: float, faults: list[tuple[Fault, int | None]]) -> list[can.Message]:
        """The frames that arrive by `now` (s), those delayed before included; faults come with the id of their motor's
        feedback.
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
    """As if the next motor's id had been set on the speed controller."""
    identifier = frame.arbitration_id
    return _copy(frame, identifier + 1 if 0x201 <= identifier < 0x208 else identifier ^ 1, frame.data)


def _copy(frame: can.Message, identifier: int, data: bytes | bytearray) -> can.Message:
    return can.Message(timestamp=frame.timestamp, arbitration_id=identifier, is_extended_id=False, data=bytes(data))
