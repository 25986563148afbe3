"""The bench test of a board on a bus: version, samples, noise, delay of answers, heater, faults; motors stay without power."""

import statistics
import time
from collections.abc import Callable
from typing import Any

import can

from gravcomp.canbus.codec import FrameError, decode, encode
from gravcomp.config import ConfigError
from gravcomp.description.hardware import CanInterface
from gravcomp.doctor import board_motor
from gravcomp.doctor.finding import Finding
from gravcomp.firmware import requests
from gravcomp.firmware.client import BoardClient
from gravcomp.firmware.settings import FAULTS, STATES

_ASKED = 50  # requests
_HEATER_PERIOD, _HEATER_END = 0.1, 1.5  # s
_STATE_WAIT = 0.5  # s; five periods of the frame
_PERIOD = 10.0  # ms between samples
_JITTER = 0.5  # ms of the board's stamps
_DELAY = 5.0  # ms: a tick, two frames and a host that is not a real-time one


def examine(
    interface: str, channel: str, seconds: float = 5.0, *, motor: int | None = None, current: float = 0.2
) -> list[Finding]:
    """Return the findings of the bench test; `seconds` for the samples and for the heater. What does not answer is a finding.

    motor: CAN id of a motor that is under power, of which a step to `current` (A) is measured.
    """
    try:
        with BoardClient(CanInterface(interface, channel)) as client:
            found = _version(client) + _samples(client, seconds) + _answers(client) + _heater(client, seconds)
            if motor is not None:
                found += board_motor.examine(client, motor, current)
            return found + _state(client)
    except ConfigError as error:
        return [Finding("missing", "board", str(error), "see src/doc/firmware.md")]


def _version(client: BoardClient) -> list[Finding]:
    version, image = int(client.value("version")), int(client.value("image"))
    chip = " ".join(f"{int(client.value(f'id_{k}')):08x}" for k in range(3))
    number = int(client.value("board_number"))
    text = f"firmware {version >> 16}.{version >> 8 & 255}, image {image:08x}, number {number}, chip {chip}"
    return [Finding("ok", "board", text)]


def _samples(client: BoardClient, seconds: float) -> list[Finding]:
    """Rate and jitter of the samples, and the noise of the sensor at rest."""
    arrivals, stamps, force, rate = [], [], [], []
    for frame in client.listen(seconds):
        values = _values(frame)
        if values is None:
            continue
        if frame.arbitration_id == 0x310:
            force.append(values[:3])
        elif frame.arbitration_id == 0x311:
            rate.append(values[:3])
        elif frame.arbitration_id == 0x312:
            stamps.append(values.time)
            arrivals.append(frame.timestamp)
    if len(stamps) < 10 or not force or not rate:
        return [Finding("missing", "samples", f"{len(stamps)} samples in {seconds:g} s", "is the BMI088 on its pins?")]
    steps = [1e-3 * ((b - a) & 0xFFFFFFFF) for a, b in zip(stamps, stamps[1:])]
    late = [1e3 * (b - a) for a, b in zip(arrivals, arrivals[1:])]
    spread = max(abs(step - statistics.median(steps)) for step in steps)
    good = abs(statistics.median(steps) - _PERIOD) < 0.02 * _PERIOD and spread < _JITTER
    text = (
        f"every {statistics.median(steps):.3f} ms by the board's stamps, at most {spread:.3f} ms off; arrival at most"
        f" {max(abs(step - _PERIOD) for step in late):.2f} ms off; expected: {_PERIOD:g} ms within 2 %, stamps"
        f" within {_JITTER:g} ms"
    )
    noise = [
        ", ".join(f"{statistics.mean(axis):.1f} +- {statistics.pstdev(axis):.1f}" for axis in zip(*counts))
        for counts in (force, rate)
    ]
    moves = all(statistics.pstdev(axis) > 0.0 for counts in (force, rate) for axis in zip(*counts))
    return [
        Finding("ok" if good else "missing", "samples", text),
        Finding(
            "ok" if moves else "missing",
            "noise",
            f"accelerometer {noise[0]} counts, gyroscope {noise[1]} counts; expected: no axis constant",
        ),
    ]


def _answers(client: BoardClient) -> list[Finding]:
    delays = []
    for _ in range(_ASKED):
        begin = time.monotonic()
        client.value("uptime")
        delays.append(1e3 * (time.monotonic() - begin))
    median, worst = statistics.median(delays), max(delays)
    text = f"median {median:.2f} ms, worst {worst:.2f} ms of {_ASKED}; expected: a median below {_DELAY:g} ms"
    return [Finding("ok" if median < _DELAY else "missing", "delay of answers", text)]


def _heater(client: BoardClient, seconds: float) -> list[Finding]:
    """Half power, then no command: the temperature must rise, and the heater go off by itself."""
    readings: list[float] = []
    duties: list[tuple[float, float]] = []
    end, due, sequence = time.monotonic() + seconds, 0.0, 0

    def take(frame: can.Message) -> None:
        values = _values(frame)
        if values is not None and frame.arbitration_id == 0x312:
            readings.append(values.temperature)
        elif values is not None and frame.arbitration_id == 0x313:
            duties.append((time.monotonic(), values.heater_duty))

    while time.monotonic() < end:
        if time.monotonic() >= due:
            due, sequence = time.monotonic() + _HEATER_PERIOD, (sequence + 1) % 256
            client.send(encode("HeaterCommand", duty=0.5, sequence=sequence))
        _each(client, 0.02, take)
    stopped = time.monotonic()
    _each(client, _HEATER_END, take)
    if not readings or not duties:
        return [Finding("missing", "heater", "no temperature or status came")]
    on = max(duty for _, duty in duties)
    off = next((when - stopped for when, duty in duties if when > stopped and duty == 0.0), None)
    gone = "not off" if off is None else f"off {1e3 * off:.0f} ms after the last command"
    text = (
        f"duty {on:.2f}, from {readings[0]:.2f} to {max(readings):.2f} degC in {seconds:g} s, {gone}; expected: duty 0.50,"
        " warmer, off after 500 to 700 ms"
    )
    good = abs(on - 0.5) < 0.01 and max(readings) > readings[0] and off is not None and off < 0.7
    return [Finding("ok" if good else "missing", "heater", text)]


def _state(client: BoardClient) -> list[Finding]:
    frame = next((f for f in client.listen(_STATE_WAIT) if f.arbitration_id == requests.STATE_ID), None)
    values = _values(frame) if frame is not None else None
    if values is None:
        return [Finding("missing", "state", f"no BoardState in {_STATE_WAIT:g} s")]
    faults = [text for bit, text in enumerate(FAULTS) if int(values.faults) >> bit & 1]
    state = int(values.state)
    name = STATES[state] if state < len(STATES) else str(state)
    counted = ", ".join(f"{key} {int(client.value(key))}" for key in ("rejected", "dropped", "slowest"))
    return [Finding("optional" if faults else "ok", "state", f"{name}; faults: {'; '.join(faults) or 'none'}; {counted} us")]


def _each(client: BoardClient, seconds: float, take: Callable[[can.Message], None]) -> None:
    for frame in client.listen(seconds):
        take(frame)


def _values(frame: can.Message) -> Any:
    """Return the values of a frame, None for a frame that is not whole or not known."""
    try:
        return decode(frame).values
    except FrameError:
        return None
