"""What others see of the bridge: its state, what its cables do, and the record by which rotors go on being counted."""

import dataclasses
import enum


class State(enum.IntEnum):
    """As in gravcomp_msgs/msg/CableState."""

    UNCONFIGURED = 0
    INACTIVE = 1
    HOMING = 2
    ACTIVE = 3
    HOLDING = 4
    STOPPED = 5
    FAULT = 6


DRIVING = frozenset({State.HOMING, State.ACTIVE, State.HOLDING})
"""The states in which motors get current."""


@dataclasses.dataclass(frozen=True)
class CableSnapshot:
    """What the cables are doing; one entry a cable. SI: m, m/s, A, N. `stamp` is that of the followed command, or None."""

    state: State
    message: str
    command: list[float]
    displacement: list[float]
    velocity: list[float]
    current: list[float]
    tension: list[float]
    stamp: object | None


@dataclasses.dataclass(frozen=True)
class RotorRecord:
    """What another process or a later run needs to go on counting a rotor: its count and zero (counts), its speed (rpm) at `time`
    (s, monotonic: the same in all processes of a host), and whether its whole turns are certain.
    """

    count: int
    zero: int
    speed: float
    time: float
    certain: bool = True


ZeroRecord = dict[int, RotorRecord]
"""By CAN id."""
