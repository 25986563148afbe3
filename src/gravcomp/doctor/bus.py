"""A CAN bus: who speaks on it."""

import time
from collections import Counter

from gravcomp.doctor.finding import Finding

_LISTEN = 2.0  # s


def examine(interface: str, channel: str) -> list[Finding]:
    """Motors and board heard within two seconds, and frames that nobody knows."""
    from gravcomp.canbus import codec
    from gravcomp.canbus.bus import BusError, open_bus
    from gravcomp.description.hardware import CanInterface

    try:
        bus = open_bus(CanInterface(interface, channel))
    except BusError as error:
        return [Finding("missing", "bus", str(error))]
    heard: Counter = Counter()
    with bus:
        end = time.monotonic() + _LISTEN
        while (left := end - time.monotonic()) > 0.0:
            frame = bus.recv(left)
            if frame is None:
                continue
            try:
                heard[codec.decode(frame).name] += 1
            except codec.FrameError as error:
                heard[f"unknown ({error})"] += 1
    if not heard:
        return [
            Finding(
                "missing",
                "bus",
                f"{interface} {channel}: nothing was heard for {_LISTEN:g} s",
                "are motors and board powered, the bus terminated?",
            )
        ]
    rates = ", ".join(f"{name} {count / _LISTEN:.0f} Hz" for name, count in sorted(heard.items()))
    return [Finding("ok", "bus", f"{interface} {channel}: {rates}")]
