"""The device of a CAN bus: whether this machine has it, and what brings it up."""

import socket

from gravcomp.config import ConfigError
from gravcomp.description.hardware import CanInterface


def check_device(settings: CanInterface) -> None:
    """Raise ConfigError for a socketcan device that this machine does not have.

    Whether the adapter of another interface is there shows only when it is opened.
    """
    if settings.interface == "socketcan" and settings.channel not in [name for _, name in socket.if_nameindex()]:
        raise ConfigError(f"socketcan {settings.channel} cannot be opened: no such device{advice(settings)}")


def advice(settings: CanInterface) -> str:
    """Return what a user can do about a bus that cannot be opened, to be added to the error; empty where nothing is known."""
    if settings.interface == "socketcan":
        return (
            f"; bring it up: sudo ip link set {settings.channel or 'can0'} up type can bitrate {settings.bitrate}"
            " restart-ms 100, and sudo ip link set " + (settings.channel or "can0") + " txqueuelen 1000"
        )
    if settings.interface == "slcan":
        return "; is the adapter plugged in, and does this user have access to it (group dialout)?"
    return ""
