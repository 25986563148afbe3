"""Buses open, isolate runs from one another, and are reopened after errors."""

import select
import socket
import time

import can
import msgpack
import pytest

from gravcomp.canbus import codec
from gravcomp.canbus.bus import BusError, open_bus
from gravcomp.canbus.device import check_device
from gravcomp.canbus.link import CanLink
from gravcomp.canbus.multicast import parse_channel, private_channel
from gravcomp.config import ConfigError
from gravcomp.description.hardware import CanInterface

FRAME = codec.encode("MotorFeedback1", angle=1, speed=2, current=0.003)


class FlakyBus:
    """A bus whose adapter can be unplugged."""

    def __init__(self):
        self.frames, self.sent, self.failure, self.shut = [], [], None, False

    def recv(self, timeout):
        if self.failure:
            raise self.failure
        return self.frames.pop(0) if self.frames else None

    def send(self, frame):
        if self.failure:
            raise self.failure
        self.sent.append(frame)

    def shutdown(self):
        self.shut = True
        raise OSError("no such device")  # like an adapter that was unplugged


class Workshop:
    """Opens FlakyBuses while `available`."""

    def __init__(self):
        self.buses, self.available, self.attempts, self.now = [], True, 0, 0.0
        self.link = CanLink(CanInterface(), opener=self.open, clock=lambda: self.now)

    def open(self, settings, frame_ids):
        self.attempts += 1
        if not self.available:
            raise BusError("can0 cannot be opened: no such device")
        self.buses.append(FlakyBus())
        return self.buses[-1]


def test_two_links_receive_each_others_frames_but_not_their_own():
    settings = CanInterface(channel=private_channel())
    a, b = CanLink(settings), CanLink(settings, [0x201])
    a.open(), b.open()
    a.send([FRAME, codec.encode("MotorFeedback2", angle=0, speed=0, current=0)])
    received = b.receive(0.5) + b.receive(0.05)
    assert [(f.arbitration_id, bytes(f.data)) for f in received] == [(0x201, bytes(FRAME.data))]
    assert a.receive(0.05) == []
    a.close(), b.close()


def test_filtered_frames_do_not_hide_later_ones():
    settings = CanInterface(channel=private_channel())
    a, b = CanLink(settings), CanLink(settings, [0x201])
    a.open(), b.open()
    a.send([codec.encode("MotorFeedback2", angle=0, speed=0, current=0), FRAME] * 20)
    assert len(b.receive(0.2)) == 20
    a.close(), b.close()


def waiting(bus):
    """Read the datagrams that wait in the bus's socket, and return their number."""
    time.sleep(0.05)
    count = 0
    while select.select([bus.fileno()], [], [], 0.0)[0]:
        bus._receiver.recv(4096)
        count += 1
    return count


@pytest.mark.parametrize(("frame_ids", "kept"), [([0x200, 0x311], 4), ([0x10, 0x200], 3), (None, 5)])
def test_filtered_frames_do_not_wake_the_process(frame_ids, kept):
    """Ids below 256 are packed differently; the kernel filter lets them pass, and the bus filters them."""
    settings = CanInterface(channel=private_channel())
    with open_bus(settings, frame_ids) as listener, open_bus(settings) as sender:
        for i in (0x10, 0x11, 0x200, 0x201, 0x311):
            sender.send(can.Message(arbitration_id=i, is_extended_id=False, data=b"12345678"))
            listener.send(can.Message(arbitration_id=i, is_extended_id=False, data=b"12345678"))
        assert waiting(listener) == kept
        assert waiting(sender) == 5


def test_a_receiver_delayed_by_0_1_s_loses_no_frame_and_has_the_right_stamps():
    """350 frames are 0.1 s of six motors at 500 Hz and the board. A receiver without delay has the same stamps: the kernel's.

    No stamp is compared with this process's clock: a busy machine stamps late, and may set its clock back.
    """
    settings = CanInterface(channel=private_channel())
    sender, prompt, delayed = (CanLink(settings) for _ in range(3))
    links = (sender, prompt, delayed)
    for link in links:
        link.open()
    stamps = []
    for batch in (175, 350):
        sender.send([FRAME] * 175)
        while len(stamps) < batch:
            frames = prompt.receive(1.0)
            assert frames, f"{batch - len(stamps)} frames do not arrive"
            stamps += [frame.timestamp for frame in frames]
        time.sleep(0.1)
    assert [frame.timestamp for frame in delayed.receive(0.0)] == stamps
    for link in links:
        link.close()


def test_private_channels_are_different():
    """The kernel gives free ports at random: of 400, three would be given twice if they were not reserved."""
    assert len({private_channel() for _ in range(400)}) == 400


def test_runs_on_private_channels_do_not_hear_each_other():
    a, b = (CanLink(CanInterface(channel=private_channel())) for _ in range(2))
    a.open(), b.open()
    a.send([FRAME])
    assert b.receive(0.1) == []
    a.close(), b.close()


def test_datagrams_that_are_no_frames_are_ignored():
    channel = private_channel()
    link, friend = CanLink(CanInterface(channel=channel)), CanLink(CanInterface(channel=channel))
    link.open(), friend.open()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        for datagram in (b"", b"\xc1", b"hello", msgpack.packb([1, 2]), msgpack.packb({"arbitration_id": "x"}), bytes(2000)):
            stranger.sendto(datagram, parse_channel(channel))
    friend.send([FRAME])
    assert [f.arbitration_id for f in link.receive(0.5)] == [0x201]
    link.close(), friend.close()


def test_python_can_itself_understands_the_datagrams():
    """So its logger and viewer can be used with a running robot."""
    channel = private_channel()
    group, port = parse_channel(channel)
    try:
        listener = can.Bus(interface="udp_multicast", channel=group, port=port, hop_limit=0)
    except can.CanInitializationError:
        pytest.skip("no route for multicast on this machine")
    link = CanLink(CanInterface(channel=channel))
    link.open()
    link.send([FRAME])
    heard = listener.recv(1.0)
    assert heard is not None and heard.arbitration_id == 0x201 and heard.data == FRAME.data
    link.close(), listener.shutdown()


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        (CanInterface(channel="10.0.0.1:5000"), "not a multicast group"),
        (CanInterface(channel="239.1.1.1:99999"), "not a multicast group"),
        (CanInterface(interface="semaphore", channel="0"), "'semaphore' is not available"),
        (CanInterface(interface="socketcan", channel="can77"), "sudo ip link set can77 up type can bitrate 1000000"),
    ],
)
def test_a_bus_that_cannot_be_opened_says_what_to_do(settings, complaint):
    with pytest.raises(BusError, match=complaint):
        open_bus(settings)


def test_an_unplugged_adapter_is_reopened_with_growing_pauses():
    shop = Workshop()
    shop.link.open()
    shop.available, shop.buses[0].failure = False, OSError("device not configured")
    assert shop.link.receive(0.0) == [] and not shop.link.is_open and shop.buses[0].shut
    assert "device not configured" in shop.link.status
    for _ in range(1000):  # 10 s without an adapter
        shop.now += 0.01
        assert shop.link.receive(0.0) == [] and not shop.link.send([FRAME])
    assert 5 <= shop.attempts <= 12
    shop.available, shop.now = True, shop.now + 2.0
    assert shop.link.send([FRAME]) and shop.buses[-1].sent == [FRAME]


def test_bus_off_and_error_frames_are_not_data():
    shop = Workshop()
    shop.link.open()
    shop.buses[0].frames = [can.Message(arbitration_id=0x04, is_error_frame=True), FRAME]
    assert shop.link.receive(0.0) == [FRAME] and shop.link.counters.error_frames == 1
    shop.buses[0].frames = [can.Message(arbitration_id=0x40, is_error_frame=True)]
    assert shop.link.receive(0.0) == [] and not shop.link.is_open and "bus-off" in shop.link.status


def test_the_bus_is_reopened_when_the_transmit_queue_stays_full():
    shop = Workshop()
    shop.link.open()
    shop.buses[0].failure = can.CanOperationError("No buffer space available")
    assert not shop.link.send([FRAME]) and shop.link.is_open
    shop.buses[0].failure = None
    assert shop.link.send([FRAME])
    shop.buses[0].failure = can.CanOperationError("No buffer space available")
    for _ in range(70):
        shop.now += 0.01
        shop.link.send([FRAME])
    assert shop.link.counters.lost == 1


def test_a_device_that_this_machine_lacks_is_named_with_what_brings_it_up():
    with pytest.raises(ConfigError, match=r"socketcan nocan7 cannot be opened: no such device.*ip link set nocan7 up"):
        check_device(CanInterface(interface="socketcan", channel="nocan7"))
    check_device(CanInterface(interface="socketcan", channel="lo"))  # whether it is a CAN device shows when it is opened
    check_device(CanInterface(interface="slcan", channel="/dev/none"))
