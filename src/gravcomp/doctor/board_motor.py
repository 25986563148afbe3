"""The part of the bench test with one motor under power: a step of its current, and the end of the current when the host dies.

The motor's cable is unhooked, so that the rotor turns freely. What is measured is what the C610 reports.
"""

import statistics
import time
from collections.abc import Callable

from gravcomp.canbus import c610
from gravcomp.canbus.codec import FrameError, decode
from gravcomp.config import ConfigError
from gravcomp.description.hardware import MOTOR_IDS
from gravcomp.doctor.finding import Finding
from gravcomp.firmware.client import BoardClient
from gravcomp.motors.output import CurrentOutput

CURRENTS = 0.05, 1.0
"""A, between which the step may be: above what the C610's noise hides, below what heats a motor that stands."""

_PERIOD = 0.004  # s between two command frames
_QUIET, _STEP = 0.3, 0.06  # s
_DEAD = 0.5  # s that are listened after the last command
_LONGEST_RISE, _LONGEST_END = 15.0, 100.0  # ms
_SHARE = 0.2  # of the step, that the current may be off

_Reading = tuple[float, float]  # time in s, current in A


def examine(client: BoardClient, motor: int, current: float) -> list[Finding]:
    """Return the findings of a current step (A) of the motor with this CAN id. Raises ConfigError for wrong numbers."""
    if motor not in MOTOR_IDS:
        raise ConfigError(f"--motor is {motor}; allowed: {min(MOTOR_IDS)} to {max(MOTOR_IDS)}, the id of its C610")
    if not CURRENTS[0] <= current <= CURRENTS[1]:
        raise ConfigError(f"--current is {current:g}; allowed: {CURRENTS[0]:g} to {CURRENTS[1]:g} A")
    before = _readings(client, motor, _QUIET)
    if not before:
        found = f"no feedback of motor {motor} in {_QUIET:g} s"
        return [Finding("missing", "feedback", found, "is it powered, and its id that of the parameter `motors`?")]
    limit = 1e-3 * client.value("current_limit")
    wanted = min(current, limit)
    output = CurrentOutput([motor], current)
    _readings(client, motor, 2.0 * _STEP, output.zero)
    begin = time.monotonic()
    rising = _readings(client, motor, _STEP, lambda: output.frames([current], enabled=True))
    last = time.monotonic()
    ending = _readings(client, motor, _DEAD)
    return [
        Finding("ok", "feedback", f"motor {motor} every {1e3 * _QUIET / len(before):.2f} ms; expected: 1 to 8 ms"),
        _step(rising, begin, wanted, limit),
        _end(ending, last, wanted),
    ]


def _readings(client: BoardClient, motor: int, seconds: float, frames: Callable | None = None) -> list[_Reading]:
    """Return the motor's currents within this time, in which `frames()` are sent at every period."""
    found, end, due = [], time.monotonic() + seconds, time.monotonic()
    while (now := time.monotonic()) < end:
        if frames is not None and now >= due:
            due = max(due + _PERIOD, now)
            for frame in frames():
                client.send(frame)
        wait = min(end, due if frames is not None else end) - time.monotonic()
        for frame in client.listen(max(wait, 1e-4)):
            if frame.arbitration_id == c610.feedback_id(motor):
                try:
                    found.append((time.monotonic(), float(decode(frame).values.current)))
                except FrameError:
                    continue
    return found


def _step(readings: list[_Reading], begin: float, wanted: float, limit: float) -> Finding:
    risen = next((when for when, value in readings if value >= 0.63 * wanted), None)
    steady = statistics.median([value for _, value in readings[-max(1, len(readings) // 3) :]]) if readings else 0.0
    took = "never" if risen is None else f"in {1e3 * (risen - begin):.1f} ms"
    good = risen is not None and 1e3 * (risen - begin) <= _LONGEST_RISE and abs(steady - wanted) <= _SHARE * wanted
    text = (
        f"{steady:.3f} A for {wanted:.3f} A (the board's limit: {limit:.3f} A), 63 % {took}; expected: within"
        f" {100 * _SHARE:.0f} %, 63 % within {_LONGEST_RISE:g} ms"
    )
    return Finding("ok" if good else "missing", "current step", text)


def _end(readings: list[_Reading], last: float, wanted: float) -> Finding:
    over = [when for when, value in readings if abs(value) > 0.1 * wanted]
    took = 1e3 * (over[-1] - last) if over else 0.0
    good = bool(readings) and took <= _LONGEST_END
    text = f"current until {took:.0f} ms after the last command of a host that stops; expected: at most {_LONGEST_END:g} ms"
    return Finding("ok" if good else "missing", "dead host", text)
