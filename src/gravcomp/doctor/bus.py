"""Check of a CAN bus: the frames received on it."""

import time
from collections import Counter

from gravcomp.doctor.finding import Finding

_LISTEN = 2.0  # s


def examine(interface: str, channel: str) -> list[Finding]:
    """Return a finding with the rates of the frames received within two seconds, unknown ones included."""
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
                f"{interface} {channel}: no frame received for {_LISTEN:g} s",
                "check that motors and board are powered and the bus is terminated",
            )
        ]
    rates = ", ".join(f"{name} {count / _LISTEN:.0f} Hz" for name, count in sorted(heard.items()))
    return [Finding("ok", "bus", f"{interface} {channel}: {rates}")]
