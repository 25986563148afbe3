"""The thread of the bridge on a loopback bus: control rate, immediate answers, ends."""

import time

import pytest
from motor_bench import HARDWARE

from gravcomp.canbus import codec
from gravcomp.canbus.imu_stream import ImuSample
from gravcomp.canbus.link import CanLink
from gravcomp.canbus.multicast import private_channel
from gravcomp.description.hardware import CanInterface, Hardware
from gravcomp.motors.driver import BridgeDriver, DriverOptions
from gravcomp.motors.state import CableSnapshot, State

STATUS = {
    "protocol": 1,
    "firmware_major": 1,
    "firmware_minor": 0,
    "accelerometer_range": 1,
    "gyroscope_range": 0,
    "heater_duty": 0,
    "flags": 0,
}


class Board:
    """Sends the feedback of six motors at rest, and the frames of the IMU board."""

    def __init__(self, can: CanInterface):
        self.link = CanLink(can, [0x200, 0x1FF, 0x320, 0x321])
        self.link.open()
        self.begin, self.samples, self.heard = time.monotonic(), 0, []

    def run(self, duration, *, each=lambda: None):
        end = time.monotonic() + duration
        while time.monotonic() < end:
            self.link.send(codec.encode(f"MotorFeedback{i}", angle=100 * i, speed=0, current=0) for i in range(1, 7))
            k = self.samples
            self.samples += 1
            self.link.send(
                [
                    codec.encode("BoardStatus", **STATUS),
                    codec.encode("ImuAccelerometer", x=5460, y=k % 7, z=0, sequence=k % 256),
                    codec.encode("ImuGyroscope", x=0, y=0, z=0, sequence=k % 256),
                    codec.encode("ImuTime", time=int(1e6 * (time.monotonic() - self.begin)), temperature=30, sequence=k % 256),
                ]
            )
            each()
            self.heard += self.link.receive(0.005)
            time.sleep(0.005)


@pytest.fixture
def pair(request):
    can = CanInterface(channel=private_channel())
    hardware = Hardware(motors=HARDWARE.motors, can=can)
    driver, board = BridgeDriver(hardware, getattr(request, "param", DriverOptions(guard=False))), Board(can)
    driver.open()
    yield driver, board
    driver.close()
    board.link.close()


def samples(driver):
    found = []
    while driver.queue.qsize():
        entry = driver.queue.get()
        if isinstance(entry, ImuSample):
            found.append(entry)
    return found


def follow(driver):
    for sample in samples(driver):
        driver.command([0.0] * 6, [0.1] * 6, round(1e9 * sample.stamp))


def test_commands_are_followed_and_traced_to_their_imu_sample(pair):
    driver, board = pair
    driver.activate()
    board.run(1.5, each=lambda: follow(driver))
    assert driver.snapshot().state is State.ACTIVE
    traces = [codec.decode(f).values.sequence for f in board.heard if f.arbitration_id == 0x321]
    assert len(traces) > 20 and all(0 < (b - a) % 256 < 128 for a, b in zip(traces, traces[1:]))  # each sample once, in order
    currents = [v for f in board.heard if f.arbitration_id == 0x200 for v in codec.decode(f).values]
    assert any(currents) and max(map(abs, currents)) <= HARDWARE.drive.current_limit


def test_an_inactive_bridge_sends_no_current_frames(pair):
    driver, board = pair
    board.run(0.3, each=lambda: follow(driver))
    assert not any(f.arbitration_id in (0x200, 0x1FF) for f in board.heard)


@pytest.mark.parametrize("end", ["stop", "deactivate", "close"])
def test_every_end_sends_zeros(pair, end):
    driver, board = pair
    driver.activate()
    board.run(1.0, each=lambda: follow(driver))
    board.heard += board.link.receive(0.0)
    board.heard.clear()
    {"stop": lambda: driver.request(lambda b, now: b.stop()), "deactivate": driver.deactivate, "close": driver.close}[end]()
    last = {f.arbitration_id: bytes(f.data) for f in board.link.receive(0.2) + board.link.receive(0.05)}
    assert last[0x200] == last[0x1FF] == bytes(8)


def test_the_heater_is_off_without_fresh_commands(pair):
    driver, board = pair
    driver.heater(0.5)
    board.run(0.3)
    driver.heater(float("nan"))
    board.run(0.3)
    duties = [codec.decode(f).values.duty for f in board.heard if f.arbitration_id == 0x320]
    assert 0.5 in duties and duties[-1] == 0.0


def test_a_reader_that_hangs_loses_only_old_entries(pair):
    driver, board = pair
    driver.activate()
    board.run(2.5)
    assert driver.queue.qsize() <= 258
    newest = samples(driver)[-1]
    assert time.time() - newest.stamp < 0.5


@pytest.mark.parametrize("pair", [DriverOptions(guard=False, state_rate=1.0)], indirect=True)
def test_a_change_of_the_state_is_reported_immediately_at_any_snapshot_rate(pair):
    driver, board = pair
    driver.activate()
    board.run(1.0)
    while driver.queue.qsize():
        driver.queue.get()
    driver.request(lambda bridge, now: bridge.stop())
    time.sleep(0.1)
    reported = [driver.queue.get() for _ in range(driver.queue.qsize())]
    assert State.STOPPED in [entry.state for entry in reported if isinstance(entry, CableSnapshot)]


def test_an_error_in_the_bridge_stops_the_motors_and_resume_recovers(pair, monkeypatch):
    driver, board = pair
    driver.activate()
    board.run(1.0, each=lambda: follow(driver))
    with monkeypatch.context() as patch:
        patch.setattr(driver.bridge, "_watch", lambda now: 1 / 0)
        board.run(0.1)
        board.heard.clear()
        board.run(0.1)
    currents = [bytes(frame.data) for frame in board.heard if frame.arbitration_id in (0x200, 0x1FF)]
    assert currents and set(currents) == {bytes(8)}
    assert driver.snapshot().state is State.STOPPED and "division by zero" in driver.snapshot().message
    board.run(0.1)
    assert driver.request(lambda bridge, now: bridge.resume(now))[0]
    board.run(0.5, each=lambda: follow(driver))
    assert driver.snapshot().state is State.ACTIVE
