"""Fault injection: faults of the bus, the motors, the cables and the board, as data.

`Fault.parse` reads a fault from a mapping such as `{kind: drop, frames: imu, probability: 0.3, duration: 2}`. frame_faults.py
applies faults of frames, robot.py the others. Everything random comes from one seeded generator.
"""

from dataclasses import dataclass
from typing import Any

from gravcomp.canbus import c610
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
    "feedback": c610.FEEDBACKS,
    "status": ("BoardStatus",),
    "command": tuple(c610.COMMANDS),
    "heater": ("HeaterCommand",),
}


@dataclass(frozen=True)
class Fault:
    """One fault; it acts for `duration` from its injection."""

    kind: str = parameter(choices=KINDS, description="kind of fault")
    duration: float = parameter(0.0, unit="s", minimum=0.0, maximum=1e6, description="0: until cleared")
    frames: str = parameter("all", choices=("all", *FRAME_GROUPS), description="group of frames, for faults of frames")
    probability: float = parameter(1.0, minimum=0.0, maximum=1.0, description="probability for each frame, for faults of frames")
    delay: float = parameter(20.0, edge="ms", minimum=0.0, maximum=60000.0, description="delay of a frame, for kind delay")
    cable: str = parameter("", description="cable whose motor is concerned, also for wrong_id and drop of feedback; empty: all")

    @staticmethod
    def parse(mapping: Any, source: str) -> "Fault":
        """Return the fault in `mapping`. Raises ConfigError, which names `source` and what is allowed."""
        return from_mapping(Fault, mapping, source=source)
