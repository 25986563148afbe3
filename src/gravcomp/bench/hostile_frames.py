"""Random and malformed CAN frames."""

import os
import random
import time

import can

from gravcomp.canbus import codec
from gravcomp.canbus.c610 import COMMAND_IDS
from gravcomp.canbus.imu_stream import IMU_FRAMES
from gravcomp.canbus.link import CanLink
from gravcomp.motors.driver import RECEIVED_FRAMES

_BURST, _BURST_PAUSE = 40, 0.005  # frames, s: about 8,000 frames per second, three times the regular traffic
_OTHER_IDS = tuple(i for i in range(0x7FF) if i not in COMMAND_IDS)


def send_hostile_frames(link: CanLink, chance: random.Random, count: int) -> None:
    """Send `count` random and malformed frames, but no motor commands, which would be the attacker's own currents."""
    for done in range(0, count, _BURST):
        link.send(_hostile_frame(chance) for _ in range(min(_BURST, count - done)))
        time.sleep(_BURST_PAUSE)


def _hostile_frame(chance: random.Random) -> can.Message:
    frame_id = chance.choice(RECEIVED_FRAMES if chance.random() < 0.7 else _OTHER_IDS)
    data = bytearray(os.urandom(chance.choice((8, 8, 8, 8, 0, 3, 7))))
    if frame_id in IMU_FRAMES and len(data) == 8 and chance.random() < 0.5:
        data[7] = codec.check_byte(frame_id, bytes(data[:7]))
    kind = chance.random()
    return can.Message(
        arbitration_id=frame_id,
        is_extended_id=kind < 0.02,
        is_remote_frame=0.02 <= kind < 0.04,
        is_error_frame=0.04 <= kind < 0.05 and not frame_id & 0x40,
        data=b"" if 0.02 <= kind < 0.04 else data,
        dlc=8 if 0.02 <= kind < 0.04 else len(data),
    )
