"""The guard: zeros when the bridge dies or hangs, one bridge per bus, turns kept for the next bridge. With real processes."""

import dataclasses
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

from gravcomp.canbus import codec
from gravcomp.canbus.link import CanLink
from gravcomp.canbus.multicast import private_channel
from gravcomp.description.hardware import CanInterface, Hardware, Motor
from gravcomp.motors.guard_client import GuardClient, GuardError
from gravcomp.motors.guard_protocol import ANSWER_TIMEOUT, GuardSettings

pytestmark = pytest.mark.slow

COUNT = 2 * 8192 - 60
"""Count of motor 1 when the bridge dies: just before the angle wraps."""

# A process in place of the bridge: sends heartbeats until it is ended.
BRIDGE = """
import sys, time
from gravcomp.description.hardware import CanInterface, Hardware, Motor, Watchdog
from gravcomp.motors.guard_client import GuardClient
from gravcomp.motors.state import RotorRecord
can, watchdog = CanInterface(channel=sys.argv[1]), Watchdog(zero_timeout=float(sys.argv[3]))
def record():
    now = time.monotonic()
    return {1: RotorRecord(int(sys.argv[4]), 5, float(sys.argv[2]), now), 5: RotorRecord(20, 6, 0.0, now)}
guard = GuardClient.connect(Hardware(motors=(Motor("a", 1), Motor("b", 5)), can=can, watchdog=watchdog), record())
print("ready", flush=True)
while guard.beat(record()):
    time.sleep(0.01)
"""


@pytest.fixture
def hardware():
    return Hardware(motors=(Motor("a", 1), Motor("b", 5)), can=CanInterface(channel=private_channel()))


@pytest.fixture
def bus(hardware):
    link = CanLink(hardware.can, [0x200, 0x1FF])
    link.open()
    yield link
    link.close()


@pytest.fixture
def bridge(hardware, bus):
    process = start_bridge(hardware)
    drain(bus)
    yield process
    process.send_signal(signal.SIGCONT)
    process.kill()
    process.wait()
    GuardClient.connect(hardware).close()  # so that the guard ends soon


def start_bridge(hardware, rpm=0, **options):
    """Start it with motor 1 turning at `rpm`."""
    command = [sys.executable, "-c", BRIDGE, hardware.can.channel, str(rpm), str(hardware.watchdog.zero_timeout), str(COUNT)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **options)
    assert process.stdout.readline() == "ready\n"
    return process


def drain(bus):
    while bus.receive(0.02):
        pass


def zeros(bus, duration):
    """Return the ids of the frames that come within the time; all must have zero current."""
    frames, deadline = [], time.monotonic() + duration
    while time.monotonic() < deadline:
        frames += bus.receive(0.02)
    assert all(bytes(frame.data) == bytes(8) for frame in frames)
    return {frame.arbitration_id for frame in frames}


def test_a_living_bridge_is_left_alone(bridge, bus):
    assert zeros(bus, 0.3) == set()


def test_a_killed_bridge_leaves_no_current(bridge, bus):
    bridge.kill()
    assert zeros(bus, 1.0) == {0x200, 0x1FF}


def test_a_bridge_that_hangs_leaves_no_current_and_may_continue(bridge, bus):
    bridge.send_signal(signal.SIGSTOP)
    assert zeros(bus, 1.0) == {0x200, 0x1FF}
    bridge.send_signal(signal.SIGCONT)
    time.sleep(0.3)
    drain(bus)
    assert zeros(bus, 0.3) == set()


def test_a_second_bridge_on_the_bus_is_refused(bridge, hardware):
    with pytest.raises(GuardError, match=f"another bridge .process {bridge.pid}. already drives"):
        GuardClient.connect(hardware)


def turn_on(hardware, rpm):
    """Turn motor 1 from COUNT at `rpm` for 0.5 s; return its last count."""
    motors, begin = CanLink(hardware.can), time.monotonic()
    while (elapsed := time.monotonic() - begin) < 0.5:
        count = COUNT + round(rpm * 8192 / 60 * elapsed)
        motors.send(
            [
                codec.encode("MotorFeedback1", angle=count % 8192, speed=rpm, current=0),
                codec.encode("MotorFeedback5", angle=20, speed=0, current=0),
            ]
        )
        time.sleep(0.002)
    motors.close()
    return count


def wait_for_rounds(bus):
    """Wait until the guard has read what has been sent: in each of its rounds it sends zeros, then reads."""
    begin, later, deadline = time.time(), 0, time.monotonic() + 60.0
    while later < 6:  # two frames a round
        later += sum(frame.timestamp > begin for frame in bus.receive(0.02))
        assert time.monotonic() < deadline


def patient(hardware):
    """Return the hardware with a watchdog that a busy machine does not exceed."""
    return dataclasses.replace(hardware, watchdog=dataclasses.replace(hardware.watchdog, zero_timeout=10.0))


def test_the_next_bridge_gets_the_turns_that_the_guard_counted(hardware, bus):
    hardware = patient(hardware)
    bridge = start_bridge(hardware)
    bridge.kill()
    bridge.wait()
    count = turn_on(hardware, 2)  # slow: a pause of the machine for 0.7 s leaves the turns certain
    assert count > 2 * 8192
    wait_for_rounds(bus)
    client = GuardClient.connect(hardware)
    kept = {can_id: (rotor.count, rotor.zero, rotor.certain) for can_id, rotor in client.record.items()}
    assert kept == {1: (count, 5, True), 5: (20, 6, True)}
    client.close()


def test_turns_that_could_not_be_counted_are_uncertain_for_the_next_bridge(hardware, bus):
    """A rotor turns at full speed when the bridge dies, and its feedback is missing for 0.1 s."""
    hardware = patient(hardware)
    process = start_bridge(hardware, rpm=2750)
    process.kill()
    process.wait()
    time.sleep(0.1)
    turn_on(hardware, 2750)
    wait_for_rounds(bus)
    client = GuardClient.connect(hardware)
    assert not client.record[1].certain and client.record[5].certain
    client.close()


def test_a_guard_that_hangs_is_killed_so_that_a_new_one_can_start(hardware, bus):
    client = GuardClient.connect(hardware)
    (guard,) = guards(hardware)
    guard.suspend()
    begin = time.monotonic()
    while client.beat(None):
        assert time.monotonic() - begin < ANSWER_TIMEOUT + 1.0
        time.sleep(0.01)
    psutil.wait_procs([guard], timeout=5.0)
    GuardClient.connect(hardware).close()


def test_a_bridge_that_hung_does_not_take_the_guard_as_hanging(hardware, bus):
    client = GuardClient.connect(hardware)
    assert client.beat(None)
    time.sleep(ANSWER_TIMEOUT + 0.2)
    assert client.beat(None)
    client.close()


def guards(hardware):
    """Return the guard processes of this bus; a dead one has no command line."""
    lines = {process: " ".join(process.info["cmdline"] or []) for process in psutil.process_iter(["cmdline"])}
    return [process for process, line in lines.items() if "gravcomp.motors.guard" in line and hardware.can.channel in line]


def test_turns_are_not_trusted_after_silence(bridge, hardware):
    bridge.kill()
    bridge.wait()
    time.sleep(hardware.watchdog.zero_timeout + 0.3)
    client = GuardClient.connect(hardware)
    assert client.record is None
    client.close()


def test_a_clean_end_ends_the_guard(hardware, bus):
    """Also with answers that are not read, and where the guard reads the good-bye late, as on a machine under load."""
    client = GuardClient.connect(hardware)
    (guard,) = guards(hardware)
    assert client.beat(None)
    time.sleep(0.1)  # in which the guard answers
    guard.suspend()
    threading.Timer(0.3, guard.resume).start()
    client.close()
    psutil.wait_procs([guard], timeout=5.0)
    assert not guard.is_running() or guard.status() == psutil.STATUS_ZOMBIE
    assert zeros(bus, 0.1) == {0x200, 0x1FF}


def test_the_guard_outlives_the_bridges_process_group(hardware, bus):
    process = start_bridge(hardware, start_new_session=True)
    drain(bus)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert zeros(bus, 1.0) == {0x200, 0x1FF}
    GuardClient.connect(hardware).close()


# The bridge itself, with two motors that hold a tension, and commands as from a controller.
DRIVER = """
import sys, time
from gravcomp.description.hardware import CanInterface, Hardware, Motor
from gravcomp.motors.driver import BridgeDriver, DriverOptions
hardware = Hardware(motors=(Motor("a", 1), Motor("b", 5)), can=CanInterface(channel=sys.argv[1]))
driver = BridgeDriver(hardware, DriverOptions(require_imu=False))
driver.open()
driver.activate()
while True:
    driver.command([0.0, 0.0], [1.0, 2.0], 0)
    time.sleep(0.01)
"""


class MotorsAtRest:
    """Sends the feedback of both motors, at rest, at 250 Hz from a thread."""

    def __init__(self, hardware):
        self._link, self._ending = CanLink(hardware.can), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ending.wait(0.004):
            self._link.send(codec.encode(f"MotorFeedback{i}", angle=1000 * i, speed=0, current=0) for i in (1, 5))

    def close(self):
        self._ending.set()
        self._thread.join()
        self._link.close()


@pytest.fixture
def driven(hardware, bus):
    """Process of a bridge that drives its motors."""
    motors = MotorsAtRest(hardware)
    process = subprocess.Popen([sys.executable, "-c", DRIVER, hardware.can.channel])
    wait_for_current(bus)
    yield process
    process.send_signal(signal.SIGCONT)
    process.kill()
    process.wait()
    GuardClient.connect(hardware).close()
    motors.close()


def wait_for_current(bus):
    deadline = time.monotonic() + 60.0
    while not any(any(frame.data) for frame in bus.receive(0.05)):
        assert time.monotonic() < deadline


def test_a_bridge_that_continues_after_a_hang_sends_no_stale_currents_and_drives_again(driven, bus):
    driven.send_signal(signal.SIGSTOP)
    time.sleep(0.2)
    drain_now(bus)
    assert zeros(bus, 1.0) == {0x200, 0x1FF}
    driven.send_signal(signal.SIGCONT)
    frames, deadline = [], time.monotonic() + 0.15
    while time.monotonic() < deadline:
        frames += bus.receive(0.02)
    assert len(frames) > 20 and not any(any(frame.data) for frame in frames[2:])  # the first two were already being sent
    wait_for_current(bus)


def test_a_guard_that_was_killed_or_hangs_is_replaced(driven, hardware, bus):
    for end in (psutil.Process.kill, psutil.Process.suspend):
        (guard,) = guards(hardware)
        assert is_connected(hardware)
        end(guard)
        deadline = time.monotonic() + 60.0
        while guards(hardware) in ([], [guard]) or not is_connected(hardware):
            assert time.monotonic() < deadline
            time.sleep(0.2)
    time.sleep(0.2)  # the first socket found may be the old guard's
    driven.kill()
    driven.wait()
    time.sleep(0.05)
    drain_now(bus)
    assert zeros(bus, 0.5) == {0x200, 0x1FF}
    client = GuardClient.connect(hardware)
    assert {can_id: (rotor.count - rotor.zero, rotor.certain) for can_id, rotor in client.record.items()} == {
        1: (0, True),
        5: (0, True),
    }
    client.close()


def is_connected(hardware):
    """Return whether the guard listens and a bridge is admitted: two sockets have this name."""
    address = GuardSettings(dataclasses.asdict(hardware.can), [], 1.0).address.replace("\0", "@")
    return Path("/proc/net/unix").read_text(encoding="utf-8").count(address) == 2


def drain_now(bus):
    """Read the frames that wait, not those to come."""
    while len(bus.receive(0.0)) > 20:
        pass
