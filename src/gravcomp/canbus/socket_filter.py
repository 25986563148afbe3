"""What a socket of the loopback bus need not even receive: its owner's own frames, and ids that nobody asked for.

A CAN driver filters ids in the kernel. Here a classic BPF program (linux/filter.h) does: without it each process of a robot would be
woken for every frame of all others, and for its own, which multicast brings back. It looks at the UDP header (source port at 0) and at
the id where python-can's packing has it,

    8: map  "timestamp" float64  28: 0xae "arb...  "arbitration_id"  43: 0xcd  44: id, 16 bits

and lets through whatever is packed in another way: the bus looks at every frame again.
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
    """Filter what `receiver` gets: nothing sent from `own_port`; of 16-bit ids only `frame_ids`, or all (None).

    Returns whether the kernel took it; the socket works as before where it does not.
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
    matches = [(_JUMP_EQUAL, n - i, 0, frame_id) for i, frame_id in enumerate(ids)]  # over the others and the drop
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
