"""State of the bridge as it is reported, and the record from which the counting of rotor turns continues."""

import dataclasses
import enum


class State(enum.IntEnum):
    """State of the bridge, with the numbers of gravcomp_msgs/msg/CableState."""

    UNCONFIGURED = 0
    INACTIVE = 1
    HOMING = 2
    ACTIVE = 3
    HOLDING = 4
    STOPPED = 5
    FAULT = 6


DRIVING = frozenset({State.HOMING, State.ACTIVE, State.HOLDING})
"""States in which the motors get current."""

RECOVERY = "; call ~/resume or ~/home to continue"
"""End of the message of a fault that is latched: the bridge stays in it until a user acts."""


@dataclasses.dataclass(frozen=True)
class CableSnapshot:
    """State of the bridge and of the cables at one time; lists have one entry per cable. SI: m, m/s, A, N.

    `stamp` is that of the command which the bridge follows, or None.
    """

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
    """Rotor of one motor: what another process or a later run needs to continue counting its turns.

    `count` and `zero` are in counts, `speed` in rpm, `time` in s (monotonic, the same in all processes of a host);
    `certain` says whether the number of whole turns in `count` is certain.
    """

    count: int
    zero: int
    speed: float
    time: float
    certain: bool = True


ZeroRecord = dict[int, RotorRecord]
"""Rotor records by `record_key`; on the only bus, or the first, that is the CAN id."""

_KEYS_A_BUS = 16


def record_key(bus: int, can_id: int) -> int:
    """Return the key of a motor's record from the index of its bus and its CAN id."""
    return _KEYS_A_BUS * bus + can_id


def record_of_bus(record: ZeroRecord | None, bus: int) -> ZeroRecord | None:
    """Return the records of the motors on one bus, by CAN id."""
    if record is None:
        return None
    return {key % _KEYS_A_BUS: rotor for key, rotor in record.items() if key // _KEYS_A_BUS == bus}
