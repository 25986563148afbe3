"""A board on a real bus: requests and their answers, with errors that say what the board or the bus lacks."""

import time
from collections.abc import Iterator, Mapping
from types import TracebackType

import can

from gravcomp.canbus.bus import BusError, open_bus
from gravcomp.canbus.codec import FrameError, decode
from gravcomp.config import ConfigError
from gravcomp.description.hardware import CanInterface
from gravcomp.firmware import model_transfer, requests
from gravcomp.firmware.requests import Answer
from gravcomp.firmware.settings import ANY_BOARD, value_of

_PATIENCE = 1.0  # s for an answer; storing stops the board for half of it
_TRIES = 3  # a frame is lost where a queue is full; what is asked twice has the same answer
_ERASING = 5.0  # s for an answer after a sector of a model is erased
_LISTEN = 0.5  # s for a heartbeat


class BoardClient:
    """One board on a bus; a context. `number`: of the board, 255 for the only one. Raises ConfigError without bus or board."""

    def __init__(self, bus: CanInterface, number: int = ANY_BOARD):
        if not (0 <= number <= 15 or number == ANY_BOARD):
            raise ConfigError(f"the board's number is {number}; allowed: 0 to 15, or 255 for the only one")
        try:
            self._bus = open_bus(bus)
        except BusError as error:
            raise ConfigError(str(error)) from error
        self.number = number

    def __enter__(self) -> "BoardClient":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._bus.shutdown()

    def ask(self, message: can.Message) -> Answer:
        """Send a request and return its answer. Raises ConfigError without one."""
        for _ in range(_TRIES):
            self.send(message)
            for frame in self.listen(_PATIENCE):
                answer = requests.answer_of(frame)
                if answer is not None and answer.key == message.data[2] and answer.operation == message.data[1]:
                    return answer
        raise ConfigError(self._why_silent())

    def transfer(self, steps: model_transfer.Step) -> None:
        """Send the frames of a transfer of a model and pass the answers to it. Raises ConfigError where the board refuses."""
        answer: model_transfer.ModelAnswer | None = None
        try:
            messages = next(steps)
            while True:
                for message in messages:
                    self.send(message)
                answer = next((a for frame in self.listen(_ERASING) if (a := model_transfer.answer_of(frame))), None)
                messages = steps.send(answer)
        except StopIteration:
            return

    def send(self, message: can.Message) -> None:
        """Send a frame that has no answer. Raises ConfigError where the bus does not take it."""
        try:
            self._bus.send(message)
        except can.CanError as error:
            raise ConfigError(f"the bus does not take frames: {error}; is it terminated, and has it 1 Mbit/s?") from error

    def listen(self, seconds: float) -> Iterator[can.Message]:
        """Yield the frames that come within this time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            frame = self._bus.recv(left)
            if frame is not None:
                yield frame

    def value(self, name: str) -> float:
        """Return a parameter or a reading. Raises ConfigError."""
        answer = self.ask(requests.read(name, self.number))
        return value_of(name, self._done(answer, f"reading {name}").value)

    def configure(self, settings: Mapping[str, float]) -> None:
        """Write parameters, read each back, and store them. Raises ConfigError where the board refuses."""
        for name, value in settings.items():
            message = requests.write(name, value, self.number)
            answer = self._done(self.ask(message), f"{name} = {value:g}")
            if answer.value != int.from_bytes(message.data[3:7], "big"):
                raise ConfigError(f"the board answers another {name} than it was given: are there two boards of one number?")
        self._done(self.ask(requests.save(self.number)), "storing the parameters")

    def boards(self) -> list[int]:
        """Return the numbers of the boards whose heartbeat is heard."""
        heard = set()
        for frame in self.listen(_LISTEN):
            if frame.arbitration_id == requests.STATE_ID:
                try:
                    heard.add(int(decode(frame).values.board))
                except FrameError:
                    continue
        return sorted(heard)

    def _done(self, answer: Answer, what: str) -> Answer:
        if not answer.done:
            raise ConfigError(f"the board refuses {what}: {answer.result}")
        return answer

    def _why_silent(self) -> str:
        heard = self.boards()
        if not heard:
            return "no board answers: is it powered, has it this firmware, and has the bus 1 Mbit/s and both terminators?"
        numbers = ", ".join(map(str, heard))
        return f"no board has the number {self.number}; on the bus: {numbers}"
