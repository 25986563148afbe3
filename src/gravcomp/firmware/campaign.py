"""Hostile frames at the emulated image and the C code at once: what must hold of their frames, and that both send the same."""

import dataclasses
import random

from gravcomp.canbus.codec import check_byte
from gravcomp.firmware.emulator.can_controller import WireFrame
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.emulator.machine import ProcessorFault
from gravcomp.firmware.host_board import HOST_BUS, MOTOR_BUS, HostBoard
from gravcomp.firmware.settings import BETWEEN

_BURST = 60  # frames a tick, the most that the ring of reception takes
_SETTINGS = {"wiring": BETWEEN, "motors": 0b00111111, "current_limit": 1000}
_IDS = (0x1FF, 0x200, 0x201, 0x202, 0x206, 0x208, 0x310, 0x313, 0x315, 0x320, 0x321, 0x322, 0x322, 0x328, 0x32F, 0x7FF, 0x000)
_COMMANDS = (0x200, 0x1FF)
_LENGTHS = {0x320: 4, 0x321: 6}


@dataclasses.dataclass
class Outcome:
    """frames and samples given to the image; violations and differences from the C code; faults of the processor, in words."""

    frames: int = 0
    samples: int = 0
    answers: int = 0
    violations: int = 0
    differences: int = 0
    faults: list[str] = dataclasses.field(default_factory=list)


def attack(frames: int, seed: int) -> Outcome:
    """Give both boards at least so many frames and samples. Raises SetupError without the tools."""
    chance, outcome = random.Random(seed), Outcome()
    image, host = ImageBoard(_SETTINGS), HostBoard(_SETTINGS)
    now = 0
    while outcome.frames + outcome.samples < frames and not outcome.faults:
        now += 1
        try:
            _millisecond(image, host, now, chance, outcome)
        except ProcessorFault as error:
            outcome.faults.append(str(error))
        if len(image.machine.resets) > 1:
            outcome.faults.append(f"reset by {image.machine.resets[-1]} after {now} ms")
    return outcome


def _millisecond(image: ImageBoard, host: HostBoard, now: int, chance: random.Random, outcome: Outcome) -> None:
    if now % 10 == 0 and now > 200:
        counts, temperature = tuple(chance.randrange(-32768, 32768) for _ in range(6)), chance.randrange(-1024, 1024)
        image.sample(counts, temperature, 1000 * now)
        host.sample(counts, temperature, 1000 * now)
        outcome.samples += 1
    elif now % 10 == 0:
        image.sample((0,) * 6, 0, 1000 * now)
        host.sample((0,) * 6, 0, 1000 * now)
    for bus in (HOST_BUS, MOTOR_BUS):
        burst = [_frame(chance) for _ in range(_BURST if chance.random() < 0.5 else chance.randrange(8))]
        image.machine.receive(bus, burst)
        for frame in burst:
            host.receive_raw(frame.identifier >> 21, frame.length, frame.data, bus, odd=bool(frame.identifier & 6))
        outcome.frames += len(burst)
    image.advance(1000 * now)
    host.advance(1000 * now)
    limit = image.word("current_limit")
    for bus in (HOST_BUS, MOTOR_BUS):
        sent = [(f.arbitration_id, bytes(f.data)) for f in image.sent(bus)]
        other = [(f.arbitration_id, bytes(f.data)) for f in host.sent(bus)]
        outcome.answers += len(sent)
        # Before 200 ms the image still sets the sensor up.
        outcome.differences += now > 200 and sent != other
        outcome.violations += sum(_violates(number, data, limit) for number, data in sent)
    outcome.violations += image.machine.duty > image.word("heater_limit")


def _violates(number: int, data: bytes, limit: int) -> bool:
    if number in _COMMANDS:
        currents = [int.from_bytes(data[k : k + 2], "big", signed=True) for k in (0, 2, 4, 6)]
        return any(abs(current) > limit for current in currents)
    return number >= 0x310 and data[-1] != check_byte(number, data[:-1])


def _frame(chance: random.Random) -> WireFrame:
    number = chance.choice(_IDS) if chance.random() < 0.85 else chance.randrange(0x800)
    length = _LENGTHS.get(number, 8) if chance.random() < 0.85 else chance.randrange(9)
    data = bytearray(chance.randbytes(8))
    if number == 0x322 and chance.random() < 0.5:
        # Not the two that differ by design: the longest tick, which depends on the processor, and the restart.
        data[0], data[1], data[2] = 255, chance.choice((1, 2, 2, 3, 4, 5, 6)), chance.randrange(0xA2)
        data[2] = 0x87 if data[2] in (0x84, 0x88) else data[2]
    if length and chance.random() < 0.7:
        data[length - 1] = check_byte(number, bytes(data[: length - 1]))
    odd = chance.choice((2, 4)) if chance.random() < 0.03 else 0
    return WireFrame(number << 21 | odd, length, bytes(data[:length]).ljust(8, b"\0"))
