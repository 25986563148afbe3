"""A new model of the loop on the board, sent over CAN (canbus/FRAMES.md): the frames in the order in which a board takes them.

The board answers every 32 frames of data. Where it misses one it says how many bytes it has, and the host goes on from there.
"""

from collections.abc import Callable, Generator
from typing import NamedTuple

import can

from gravcomp.canbus.codec import check_byte
from gravcomp.config import ConfigError
from gravcomp.firmware.settings import FORGET_WORD
from gravcomp.firmware.standalone_loop import REFUSALS

REQUEST_ID, DATA_ID, REPLY_ID = 0x329, 0x32A, 0x319
SLOT, SECTOR, WINDOW, BYTES = 0x60000, 0x20000, 32, 7
"""Bytes of a place for a model and of what is erased at once; frames that are answered together; bytes in one of them."""

OPERATIONS = {"data": 0, "begin": 1, "erase": 2, "end": 3, "where": 4, "forget": 5}
_TRIES = 5  # in a row without a byte more

RESULTS = (
    "done", "it has no loop that takes models", "the transfer has not begun: it was restarted, or began to drive motors",
    "the model does not fit into its place of 384 KB", "it drives motors: stop it first", "the flash does not take the model",
    "refused", "frames were lost",
)  # fmt: skip
"""Meaning of the results, GC_STORE_ of standalone/model_store.h."""

_DONE, _REFUSED, _LOST = 0, 6, 7


class ModelAnswer(NamedTuple):
    """What a board says of the transfer: operation, result, why the last model was refused, bytes that it has."""

    operation: int
    result: int
    status: int
    taken: int

    @property
    def reason(self) -> str:
        """Why it is not done, in words; empty: it is."""
        if self.result == _DONE:
            return ""
        if self.result == _REFUSED:
            return f"the model is refused: {REFUSALS[self.status] if self.status < len(REFUSALS) else f'status {self.status}'}"
        return RESULTS[self.result] if self.result < len(RESULTS) else f"result {self.result}"


Step = Generator[list[can.Message], ModelAnswer | None, None]
"""Yields frames to send; receives the answer to them, None: there was none."""


def answer_of(message: can.Message) -> ModelAnswer | None:
    """Return the answer in a frame, None for any other frame."""
    data = bytes(message.data)
    if message.arbitration_id != REPLY_ID or len(data) != 8 or check_byte(REPLY_ID, data[:-1]) != data[-1]:
        return None
    return ModelAnswer(data[0], data[1], data[2], int.from_bytes(data[3:7], "big"))


def request(operation: str, value: int = 0, sector: int = 0) -> can.Message:
    """Return a request; value: bytes of the blob, or the word that forgets."""
    data = bytes([OPERATIONS[operation], sector]) + value.to_bytes(4, "big") + b"\0"
    return can.Message(arbitration_id=REQUEST_ID, is_extended_id=False, data=data + bytes([check_byte(REQUEST_ID, data)]))


def sending(blob: bytes, progress: Callable[[int], None] | None = None) -> Step:
    """Yield the frames that bring a model onto the board; progress receives the bytes that it has. Raises ConfigError."""
    _done((yield [request("begin", len(blob))]))
    for sector in range(-(-len(blob) // SECTOR)):
        _done((yield [request("erase", sector=sector)]))
    taken, tries = 0, 0
    while taken < len(blob):
        answer = yield _frames(blob, taken)
        if answer is None:
            answer = yield [request("where")]
        if answer is not None and answer.result != _LOST:
            _done(answer)
        before, taken = taken, taken if answer is None else answer.taken
        tries = tries + 1 if taken <= before else 0
        if tries == _TRIES:
            raise ConfigError(f"the board has {taken} of {len(blob)} bytes of the model and takes no more: is the bus busy?")
        if progress is not None:
            progress(taken)
    _done((yield [request("end")]))


def forgetting() -> Step:
    """Yield the frame that leaves the board without a model, so that it takes one of another robot. Raises ConfigError."""
    _done((yield [request("forget", FORGET_WORD)]))


def _frames(blob: bytes, taken: int) -> list[can.Message]:
    """Return the frames until the next answer."""
    first = taken // BYTES
    last = min(-(-len(blob) // BYTES), (first // WINDOW + 1) * WINDOW)
    return [
        can.Message(
            arbitration_id=DATA_ID,
            is_extended_id=False,
            data=bytes([index % 256]) + blob[BYTES * index : BYTES * (index + 1)].ljust(BYTES, b"\0"),
        )
        for index in range(first, last)
    ]


def _done(answer: ModelAnswer | None) -> None:
    if answer is None:
        raise ConfigError(
            "the board does not answer: has it the firmware with the loop (`./gravcomp firmware build --standalone`)?"
        )
    if answer.reason:
        raise ConfigError(f"the board does not take the model: {answer.reason}; the old one goes on")
