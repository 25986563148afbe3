"""Opening a CAN bus by interface and channel, with errors that say what the user can do."""

import can
from can.typechecking import CanFilters

from gravcomp.canbus.device import advice
from gravcomp.canbus.multicast import LoopbackMulticastBus, enlarge_receive_buffer
from gravcomp.description.hardware import CanInterface


class BusError(Exception):
    """The bus cannot be opened. The text is shown to the user."""


def open_bus(settings: CanInterface, frame_ids: list[int] | None = None) -> can.BusABC:
    """Open the bus. With `frame_ids`, only these standard frames (and error frames) are received.

    `udp_multicast` with hop_limit 0 stays on this host, see `gravcomp.canbus.multicast`. Raises BusError.
    """
    filters: CanFilters | None = None
    if frame_ids:
        filters = [{"can_id": i, "can_mask": 0x7FF, "extended": False} for i in frame_ids]
    name = f"{settings.interface} {settings.channel}".strip()
    try:
        if settings.interface == "udp_multicast" and settings.hop_limit == 0:
            return LoopbackMulticastBus(settings.channel, can_filters=filters)
        bus = can.Bus(interface=settings.interface, can_filters=filters, **_options(settings))
        if settings.interface == "socketcan":
            enlarge_receive_buffer(bus.socket)  # type: ignore[attr-defined]  # can.Bus returns a SocketcanBus here
        return bus
    except can.CanInterfaceNotImplementedError as error:
        known = ", ".join(sorted(can.VALID_INTERFACES))
        raise BusError(f"CAN interface '{settings.interface}' is not available ({error}); known: {known}") from error
    except can.CanError as error:
        raise BusError(f"{name} cannot be opened: {error}{advice(settings)}") from error
    except (OSError, ValueError, TypeError, ImportError) as error:
        raise BusError(f"{name} cannot be opened: {error}{advice(settings)}") from error


def _options(settings: CanInterface) -> dict:
    """Return the keyword arguments for this interface of python-can."""
    if settings.interface == "udp_multicast":
        group, _, port = settings.channel.partition(":")
        return {"channel": group, "hop_limit": settings.hop_limit, "fd": False} | ({"port": int(port)} if port else {})
    if settings.interface in ("socketcan", "virtual"):  # the bit rate of a socketcan device is set by `ip link`
        return {"channel": settings.channel}
    return {"channel": settings.channel, "bitrate": settings.bitrate}
