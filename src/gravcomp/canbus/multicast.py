"""A CAN bus between the processes of one host: python-can's `udp_multicast` frames over the loopback interface.

The datagrams are those of python-can's `udp_multicast` interface, so its tools (`python -m can.logger`) can receive them.
python-can's own bus class needs a route for multicast and sends on the default network interface; this one uses the loopback
interface, so that it works without a network and no frame leaves the host. It does not receive its own frames, receives only from
its own group and port, and ignores datagrams that are not frames (counted in `undecodable`).
"""

import select
import socket
import struct
import time

import can
import msgpack
from can.interfaces.udp_multicast.utils import pack_message

from gravcomp.canbus.socket_filter import attach

DEFAULT_CHANNEL = "239.74.163.2:43113"
_LOOPBACK = socket.inet_aton("127.0.0.1")
_SO_TIMESTAMPNS = 35
_TIMESPEC = struct.Struct("@ll")
_SO_RCVBUFFORCE = 33
_RECEIVE_BUFFER = 1 << 20  # bytes: about 2500 frames, 0.7 s of full traffic
_TAKEN: list[socket.socket] = []  # keep the ports of private_channel


class LoopbackMulticastBus(can.BusABC):
    """Classic CAN frames over UDP multicast on the loopback interface; `channel` is 'group' or 'group:port' (IPv4).

    Raises can.CanInitializationError when the group cannot be joined.
    """

    def __init__(self, channel: str = DEFAULT_CHANNEL, can_filters: can.typechecking.CanFilters | None = None, **_: object):
        self._is_shutdown = True  # until the bus is open
        group, port = parse_channel(channel)
        self.undecodable = 0
        self.channel_info = f"udp_multicast {group}:{port} on loopback"
        try:
            self._sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _LOOPBACK)
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            self._sender.bind(("127.0.0.1", 0))
            self._receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            enlarge_receive_buffer(self._receiver)
            self._receiver.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
            self._receiver.bind((group, port))
            self._receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + _LOOPBACK)
            self._receiver.setblocking(False)
        except OSError as error:
            raise can.CanInitializationError(f"cannot join {group}:{port} on the loopback interface: {error.strerror}") from error
        self._destination = (group, port)
        self._own_address = self._sender.getsockname()
        self._is_shutdown = False
        super().__init__(channel, can_filters)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            try:
                datagram, ancillary, _, address = self._receiver.recvmsg(4096, 64)
            except BlockingIOError:
                remaining = None if deadline is None else deadline - time.monotonic()
                if (remaining is not None and remaining <= 0) or not select.select([self._receiver], [], [], remaining)[0]:
                    return None, False
                continue
            except (OSError, ValueError) as error:
                raise can.CanOperationError(f"cannot receive from {self.channel_info}: {error}") from error
            if address != self._own_address:
                message = self._decode(datagram, ancillary)
                # Filtered here: BusABC.recv would take an unwanted frame as a sign that no more frames wait.
                if message is not None and self._is_wanted(message):
                    return message, True

    def _decode(self, datagram: bytes, ancillary: list) -> can.Message | None:
        try:
            fields = msgpack.unpackb(datagram, raw=False)
            fields["timestamp"] = _timestamp(ancillary)
            if fields["is_fd"] or not 0 <= fields["arbitration_id"] < 1 << 29:
                raise ValueError("not a classic CAN frame")
            message = can.Message(**fields)
            if len(message.data) > 8 or message.dlc > 8 or (not message.is_remote_frame and message.dlc != len(message.data)):
                raise ValueError("not a classic CAN frame")
            return message
        except Exception:  # any datagram from another program must be ignored, not end the receiver
            self.undecodable += 1
            return None

    def _apply_filters(self, filters: can.typechecking.CanFilters | None) -> None:
        self._ids: frozenset[int] | None = None  # the only ids received, when the filters are exact
        if filters is not None and all(f["can_mask"] == 0x7FF and f.get("extended") is False for f in filters):
            self._ids = frozenset(f["can_id"] for f in filters)
        attach(self._receiver, self._own_address[1], sorted(self._ids) if self._ids else None)

    def _is_wanted(self, message: can.Message) -> bool:
        if self._ids is None:
            return self._matches_filters(message)
        return message.arbitration_id in self._ids and not message.is_extended_id

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame. Raises can.CanOperationError; `timeout` is not used."""
        try:
            self._sender.sendto(pack_message(msg), self._destination)
        except OSError as error:
            raise can.CanOperationError(f"cannot send to {self.channel_info}: {error}") from error

    def fileno(self) -> int:
        """Return the file descriptor of the receiving socket."""
        return self._receiver.fileno()

    def shutdown(self) -> None:
        """Close the bus."""
        super().shutdown()
        self._sender.close()
        self._receiver.close()


def parse_channel(channel: str) -> tuple[str, int]:
    """Return group and port of a channel, ('239.74.163.2', 43113) of '239.74.163.2:43113'.

    Raises can.CanInitializationError when the channel is not a multicast group.
    """
    group, _, port = channel.partition(":")
    try:
        number = int(port or DEFAULT_CHANNEL.partition(":")[2])
        if not 224 <= socket.inet_aton(group)[0] <= 239 or not 0 < number < 65536:
            raise ValueError
    except (ValueError, OSError):
        raise can.CanInitializationError(
            f"channel '{channel}' is not a multicast group; a group and port like '{DEFAULT_CHANNEL}' are needed"
        ) from None
    return group, number


def enlarge_receive_buffer(receiver: socket.socket) -> None:
    """Enlarge the receive buffer, so that a delayed receiver loses no frame.

    Without the rights of root the kernel limits it to net.core.rmem_max (512 frames by default).
    """
    try:
        receiver.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _RECEIVE_BUFFER)
    except OSError:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)


def private_channel() -> str:
    """Return a channel that no other run on this host uses: its own group, and a port reserved until this process ends.

    The port is reserved by a socket on 127.0.0.1, where no bus listens, so that the kernel gives it to no other process.
    """
    probe = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    probe.bind(("127.0.0.1", 0))
    _TAKEN.append(probe)
    port = probe.getsockname()[1]
    return f"239.74.{port >> 8}.{port & 0xFF}:{port}"


def _timestamp(ancillary: list) -> float:
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            return seconds + nanoseconds * 1e-9
    return time.time()
