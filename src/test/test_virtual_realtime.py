"""The virtual robot on a bus, in real time."""

import threading
from types import SimpleNamespace

import can
import pytest
from virtual_article import article, virtual_robot

from gravcomp.canbus.bus import BusError
from gravcomp.canbus.codec import decode, encode
from gravcomp.motors.encoder import stays_countable
from gravcomp.virtual import realtime
from gravcomp.virtual.realtime import RealtimeRobot


class Truths:
    """The last ground truth of the robot, with a wait for the next one that fulfils a condition."""

    def __init__(self):
        self.last = None
        self._arrived = threading.Condition()

    def __call__(self, truth):
        with self._arrived:
            self.last = truth
            self._arrived.notify()

    def wait(self, condition=lambda truth: True):
        with self._arrived:
            self.last = None
            assert self._arrived.wait_for(lambda: self.last is not None and condition(self.last), timeout=20.0)


class Clock:
    """Stands in for the module `time`: it advances by what is slept, and once by a pause of the machine."""

    def __init__(self, pause):
        self.now, self.slept, self.pause = 0.0, 0, pause

    def monotonic(self):
        return self.now

    def sleep(self, duration):
        self.slept += 1
        self.now += duration + (self.pause if self.slept == 10 else 0.0)


class Turning:
    """Stands in for a robot whose motors turn at a speed; it stops the loop after so many steps."""

    def __init__(self, speed, live, steps):
        self.speed, self.live, self.steps, self.skipped = speed, live, steps, []

    def keeps_turns(self, duration):
        return stays_countable(self.speed, duration)

    def skip(self, duration):
        self.skipped.append(duration)
        return duration

    def step(self, period, frames):
        self.steps -= 1
        if self.steps == 0:
            self.live._stop.set()
        return []


@pytest.mark.parametrize(("speed", "pause", "skips"), [(0.0, 0.3, 1), (1500.0, 0.3, 0), (1500.0, 0.7, 1), (1500.0, 0.05, 0)])
def test_a_pause_is_skipped_where_no_turn_of_a_motor_is_lost_and_caught_up_else(monkeypatch, speed, pause, skips):
    """Unless it is so long that samples would be late for too long."""
    live = RealtimeRobot(virtual_robot(), on("virtual", "pause"), lambda truth: None, truth_rate=0.1)
    clock = Clock(pause)
    live.robot = robot = Turning(speed, live, steps=500)
    live.link = SimpleNamespace(receive=lambda timeout: [], send=lambda frames: True)
    monkeypatch.setattr(realtime, "time", clock)
    live._loop()
    assert len(robot.skipped) == skips
    # Virtual time follows the clock: what was not skipped was computed.
    assert clock.now == pytest.approx(500 * live._period + live.lost_time, abs=2.0 * live._period)


def on(interface, channel):
    return article()[1].on(interface, channel)


@pytest.fixture
def running(request):
    truths = Truths()
    live = RealtimeRobot(virtual_robot(), on("virtual", request.node.name), truths, truth_rate=100.0)
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        live.start()
        yield live, bus, truths
        live.stop()


def test_frames_go_out_and_commands_come_in(running):
    live, bus, truths = running
    truths.wait()
    # The status is sent every 100 ms, among about 320 other frames.
    seen = {decode(bus.recv(5.0)).name for _ in range(700)}
    assert seen >= {"MotorFeedback1", "MotorFeedback6", "ImuAccelerometer", "ImuGyroscope", "ImuTime", "BoardStatus"}
    bus.send(encode("MotorCommand1to4", current_1=0.25, current_2=0.0, current_3=0.0, current_4=0.0))
    bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=b"noise"))
    truths.wait(lambda truth: truth.current[0] == 0.25)
    assert live.error is None and live.robot.refused == 0, "frames for other receivers do not pass the filter"


def test_after_stop_nothing_is_sent_and_a_new_start_continues(running):
    live, bus, truths = running
    truths.wait()
    live.stop()
    time = live.robot.time
    while bus.recv(0.0) is not None:
        pass
    assert bus.recv(0.05) is None
    live.start()
    truths.wait(lambda truth: truth.time > time)


def test_an_error_in_the_thread_is_kept_for_the_node(running):
    live, _, truths = running
    truths.wait()

    def broken(*_):
        raise RuntimeError("broken on purpose")

    with live.lock:
        live.robot.step = broken
    live._thread.join(timeout=20.0)
    assert str(live.error) == "broken on purpose"


def test_a_bus_that_does_not_exist_is_refused_by_name():
    with pytest.raises(BusError, match="nosuch"):
        RealtimeRobot(virtual_robot(), on("nosuch", "0"), lambda truth: None, 100.0).start()
