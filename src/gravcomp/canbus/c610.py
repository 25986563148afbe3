"""Frames of the C610 speed controllers: names, ids, and the currents in them (FRAMES.md). No other module contains these."""

from collections.abc import Mapping
from typing import Any

import can

from gravcomp.canbus import codec
from gravcomp.description.hardware import MOTOR_IDS

COMMANDS = {"MotorCommand1to4": range(1, 5), "MotorCommand5to8": range(5, 9)}
"""CAN ids of the motors whose currents are in each command frame."""

COMMAND_IDS = (0x200, 0x1FF)
"""Ids of the command frames."""

FEEDBACKS = tuple(f"MotorFeedback{can_id}" for can_id in MOTOR_IDS)
"""Names of the feedback frames."""

LARGEST_CURRENT = 10.0
"""A, that a controller accepts."""

COUNTS_PER_AMPERE = 1000
"""Resolution of the currents in a command frame."""

_FEEDBACK = 0x200  # id of a feedback frame minus the motor's CAN id


def feedback_id(can_id: int) -> int:
    """Return the id of the feedback frame of the motor `can_id`."""
    return _FEEDBACK + can_id


def motor_of(frame_id: int) -> int | None:
    """Return the CAN id of the motor whose feedback the frame is, None for other frames."""
    can_id = frame_id - _FEEDBACK
    return can_id if can_id in MOTOR_IDS else None


def command(name: str, currents: Mapping[int, float]) -> can.Message:
    """Return the command frame `name` with the currents (A) by CAN id; a motor without a current gets zero.

    Only `motors.output` calls it in the product, because it limits the currents.
    """
    return codec.encode(name, **{f"current_{can_id}": currents.get(can_id, 0.0) for can_id in COMMANDS[name]})


def currents_of(name: str, values: Any) -> dict[int, float]:
    """Return the currents (A) by CAN id in a decoded frame; empty for a frame that is not a command."""
    return {can_id: getattr(values, f"current_{can_id}") for can_id in COMMANDS.get(name, ())}


def feedback(can_id: int, angle: float, speed: float, current: float) -> can.Message:
    """Return the feedback frame of the motor `can_id`: angle (counts), speed of the rotor (rpm), current (A)."""
    return codec.encode(f"MotorFeedback{can_id}", angle=angle, speed=speed, current=current)
