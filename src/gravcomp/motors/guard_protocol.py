"""Protocol between the bridge and its guard process: JSON messages over a local socket, one per bus.

    bridge -> guard    {"hello": pid, "beat": record}     first message; the record that the bridge has itself, or null
    guard -> bridge    {"record": record}                 admitted, with the record of an earlier run, or null
                       {"busy": pid}                      refused: this process already drives the bus
    bridge -> guard    {"beat": record}                   heartbeat
    guard -> bridge    {}                                 answer to a heartbeat
    bridge -> guard    {"bye": true}                      clean end; the currents are zero

A record maps CAN ids to [count, zero, speed, time, certain], see RotorRecord.
"""

import dataclasses
import hashlib
import json
import socket

from gravcomp.description.hardware import CanInterface, Hardware
from gravcomp.motors.state import RotorRecord, ZeroRecord

ANSWER_TIMEOUT = 1.0
"""s without an answer to a heartbeat after which the guard counts as hanging."""

BEAT_TIMEOUT = 0.1
"""s without a heartbeat after which the bridge counts as hanging."""

LONGEST_MESSAGE = 65536
"""bytes"""


@dataclasses.dataclass(frozen=True)
class GuardSettings:
    """Settings of the guard process: the bus, the motors, and the silence (s) after which their turns are lost."""

    can: dict
    can_ids: list[int]
    zero_timeout: float

    @classmethod
    def of(cls, hardware: Hardware, bus: int = 0) -> "GuardSettings":
        """Return the settings for the bus with this index in `hardware.all_buses`."""
        can_ids = [motor.can_id for motor in hardware.motors if hardware.bus_index(motor) == bus]
        settings = hardware.all_buses[bus]
        can = {field.name: getattr(settings, field.name) for field in dataclasses.fields(CanInterface)}
        return cls(can, can_ids, hardware.watchdog.zero_timeout)

    @property
    def address(self) -> str:
        """Name of the local socket, in the abstract namespace; one per bus."""
        name = json.dumps([self.can["interface"], self.can["channel"]])
        return "\0gravcomp-guard-" + hashlib.sha1(name.encode()).hexdigest()[:20]


def new_socket() -> socket.socket:
    """Return an unconnected socket of the kind that both ends use."""
    return socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def encoded(record: ZeroRecord | None) -> dict[int, tuple] | None:
    """Return the record as the content of a message."""
    return {can_id: dataclasses.astuple(rotor) for can_id, rotor in record.items()} if record else None


def decoded(content: dict | None) -> ZeroRecord | None:
    """Return the inverse of `encoded`."""
    return {int(can_id): RotorRecord(*rotor) for can_id, rotor in content.items()} if content else None
