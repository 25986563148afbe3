"""Pickled messages over a socket, with an end that never waits: what is there is taken, and what does not fit yet is kept.

A message may come in pieces, because the process at the other end may be preempted in the middle of it. The end that may wait
reads with `pickle.load` and writes `framed` messages: the number of bytes, then the pickle.
"""

import contextlib
import pickle
import socket
import struct
from collections.abc import Iterator
from typing import Any

_SIZE = struct.Struct("!Q")
_PIECE = 1 << 16  # bytes that are read at once


def framed(message: Any) -> bytes:
    """Return a message as bytes that say how many they are."""
    pickled = pickle.dumps(message)
    return _SIZE.pack(len(pickled)) + pickled


class PatientEnd:
    """The end whose owner must not wait. The other end sends `framed` messages, and takes pickled ones."""

    def __init__(self, end: socket.socket):
        """end: one of a pair of connected sockets; it is owned from now on."""
        end.setblocking(False)
        self._end = end
        self._received, self._unsent = bytearray(), bytearray()

    def send(self, message: Any) -> None:
        """Send a message, as much of it as the socket takes now; the rest goes with the next calls of `received`."""
        self._unsent += pickle.dumps(message)
        self._pass_on()

    def received(self) -> Iterator[Any]:
        """Return the messages that have come as a whole. Raises EOFError or OSError after them, where the other end is closed."""
        open_end = True
        with contextlib.suppress(BlockingIOError):
            while open_end:
                piece = self._end.recv(_PIECE)
                self._received += piece
                open_end = bool(piece)
        while (message := self._next_message()) is not None:
            yield pickle.loads(message)
        if not open_end:
            raise EOFError
        self._pass_on()

    def close(self) -> None:
        """Close this end; `send` and `received` raise OSError from now on."""
        self._end.close()

    def _next_message(self) -> bytes | None:
        if len(self._received) < _SIZE.size:
            return None
        end = _SIZE.size + _SIZE.unpack_from(self._received)[0]
        if len(self._received) < end:
            return None
        message = bytes(self._received[_SIZE.size : end])
        del self._received[:end]
        return message

    def _pass_on(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._unsent:
                del self._unsent[: self._end.send(self._unsent)]
