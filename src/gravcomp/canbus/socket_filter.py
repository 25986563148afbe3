"""Kernel filter for the sockets of the loopback bus: drops the process's own frames, and ids that it does not use.

A CAN driver filters ids in the kernel. For the loopback bus a classic BPF program (linux/filter.h) does it. Without the filter
each process of a robot would be woken for every frame of all others, and for its own frames, which multicast returns. The program
reads the UDP header (source port at byte 0) and the id at the place where python-can packs it:

    8: map  "timestamp" float64  28: 0xae "arb...  "arbitration_id"  43: 0xcd  44: id, 16 bits

A datagram that is packed differently passes; the bus checks every frame again.
"""

import ctypes
import socket
import struct
from collections.abc import Sequence

_SO_ATTACH_FILTER = 26
_INSTRUCTION = struct.Struct("=HBBI")  # code, jump if true, jump if false, operand
_LOAD_LENGTH, _LOAD_BYTE, _LOAD_HALF, _LOAD_WORD, _JUMP_EQUAL, _JUMP_AT_LEAST, _RETURN = 0x80, 0x30, 0x28, 0x20, 0x15, 0x35, 0x06
_MOST_IDS = 64  # jumps reach 255 instructions
_LABEL = 0xAE617262  # the first four bytes of the packed key "arbitration_id"
_KEY, _KIND, _ID, _SHORTEST = 28, 43, 44, 46
_UINT16 = 0xCD


def attach(receiver: socket.socket, own_port: int, frame_ids: Sequence[int] | None) -> bool:
    """Let `receiver` drop frames sent from `own_port`, and 16-bit ids other than `frame_ids` (None: keep all ids).

    Return whether the kernel accepted the filter; if not, the socket works as before.
    """
    ids = None if frame_ids is None or len(frame_ids) > _MOST_IDS else frame_ids
    program = _program(own_port, ids)
    code = ctypes.create_string_buffer(b"".join(_INSTRUCTION.pack(*instruction) for instruction in program))
    try:
        receiver.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("@HP", len(program), ctypes.addressof(code)))
    except OSError:
        return False
    return True


def _program(own_port: int, ids: Sequence[int] | None) -> list[tuple[int, int, int, int]]:
    accept, drop = (_RETURN, 0, 0, 0x7FFFFFFF), (_RETURN, 0, 0, 0)
    if ids is None:
        return [(_LOAD_HALF, 0, 0, 0), (_JUMP_EQUAL, 0, 1, own_port), drop, accept]
    n = len(ids)
    matches = [(_JUMP_EQUAL, n - i, 0, frame_id) for i, frame_id in enumerate(ids)]  # jump over the other ids and the drop
    return [
        (_LOAD_HALF, 0, 0, 0),
        (_JUMP_EQUAL, n + 7, 0, own_port),
        (_LOAD_LENGTH, 0, 0, 0),
        (_JUMP_AT_LEAST, 0, n + 6, _SHORTEST),
        (_LOAD_WORD, 0, 0, _KEY),
        (_JUMP_EQUAL, 0, n + 4, _LABEL),
        (_LOAD_BYTE, 0, 0, _KIND),
        (_JUMP_EQUAL, 0, n + 2, _UINT16),
        (_LOAD_HALF, 0, 0, _ID),
        *matches,
        drop,
        accept,
    ]
