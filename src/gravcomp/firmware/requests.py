"""Requests to the board and its answers (canbus/FRAMES.md): parameters, zero positions, actions."""

from typing import NamedTuple

import can

from gravcomp.canbus.codec import FrameError, decode, encode
from gravcomp.config import ConfigError
from gravcomp.firmware.settings import ACTIONS, ANY_BOARD, OPERATIONS, RESULTS, SAVE_WORD, keys, word_of

REPLY_ID, STATE_ID = 0x314, 0x315

READINGS = {
    "id_0": 0x80, "id_1": 0x81, "id_2": 0x82, "version": 0x83, "image": 0x84, "reset": 0x85, "uptime": 0x86, "rejected": 0x87,
    "slowest": 0x88, "dropped": 0x89, "homing": 0x8A,
}  # fmt: skip
"""Keys of what can only be read. That of the displacement of motor k + 1 is DISPLACEMENT + k."""

DISPLACEMENT, ZERO_KNOWN = 0x90, 0x98


class Answer(NamedTuple):
    """A BoardReply."""

    board: int
    operation: int
    result: str
    key: int
    value: int

    @property
    def done(self) -> bool:
        """Whether the board has done what was asked."""
        return self.result == RESULTS[0]


def request(operation: str, key: int = 0, value: int = 0, board: int = ANY_BOARD) -> can.Message:
    """Return a BoardRequest; `operation` is one of OPERATIONS, `value` 32 bits with or without a sign."""
    return encode("BoardRequest", board=board, operation=OPERATIONS[operation], key=key, value=value & 0xFFFFFFFF)


def read(name: str, board: int = ANY_BOARD) -> can.Message:
    """Return the request for a parameter or a reading. Raises ConfigError for an unknown name."""
    key = READINGS.get(name, keys().get(name))
    if key is None:
        raise ConfigError(f"the board has no value {name}; allowed: {', '.join([*keys(), *READINGS])}")
    return request("read", key, board=board)


def write(name: str, value: float, board: int = ANY_BOARD) -> can.Message:
    """Return the request that sets a parameter. Raises ConfigError for an unknown name or what a word cannot hold."""
    word = word_of(name, value)
    return request("write", keys()[name], word, board)


def save(board: int = ANY_BOARD) -> can.Message:
    """Return the request that stores the parameters."""
    return request("save", value=SAVE_WORD, board=board)


def act(action: str, board: int = ANY_BOARD) -> can.Message:
    """Return the request for an action; one of ACTIONS."""
    return request("act", ACTIONS[action], board=board)


def answer_of(message: can.Message) -> Answer | None:
    """Return the answer in a frame, None for any other frame."""
    if message.arbitration_id != REPLY_ID:
        return None
    try:
        values = decode(message).values
    except FrameError:
        return None
    code = values.result & 15
    result = RESULTS[code] if code < len(RESULTS) else f"code {code}"
    return Answer(int(values.board), values.result >> 4, result, int(values.key), int(values.value))
