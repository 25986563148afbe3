"""CAN buses as data: one, or several with names. A C610 bus carries eight motors, so more motors need more buses."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class CanInterface:
    """A CAN bus, named by python-can's interface and channel."""

    interface: str = parameter(
        "udp_multicast",
        description="python-can interface: udp_multicast (virtual robot), socketcan, slcan, pcan, ...",
        read_only=True,
    )
    channel: str = parameter(
        "239.74.163.2:43113", description="channel: can0, /dev/ttyACM0, or multicast group:port", read_only=True
    )
    bitrate: int = parameter(
        1_000_000,
        unit="bit/s",
        minimum=10_000,
        maximum=1_000_000,
        description="used by interfaces that set the bit rate",
        read_only=True,
    )
    hop_limit: int = parameter(
        0, minimum=0, maximum=255, description="hop limit of udp_multicast; 0: no frame leaves this host", read_only=True
    )

    @property
    def label(self) -> str:
        """Interface and channel, for messages."""
        return f"{self.interface} {self.channel}".strip()


@dataclasses.dataclass(frozen=True, kw_only=True)
class CanBus(CanInterface):
    """One of several CAN buses."""

    name: str = parameter(description="name of the bus, which motors refer to")

    @property
    def label(self) -> str:
        """Name, interface and channel, for messages."""
        return f"bus '{self.name}' ({super().label})" if self.name else super().label
