"""The node can_bridge as a process, on a bus with simulated motors and board: topics, services, refusals, exit."""

import os
import signal
import subprocess
import sys
import threading
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))

import pytest
import rclpy
from sensor_msgs.msg import Imu, JointState, Temperature
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from gravcomp.canbus import codec
from gravcomp.canbus.link import CanLink
from gravcomp.canbus.multicast import private_channel
from gravcomp.description.hardware import CanInterface
from gravcomp_msgs.msg import CableCommand, CableState
from gravcomp_node import COMMAND, SENSOR

# A test run under nohup would pass the ignored SIGHUP on to its children.
signal.signal(signal.SIGHUP, signal.SIG_DFL)

ZERO = bytes(8)
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
    """Six motors and an IMU at rest, simulated in a thread; `currents` holds the last frame of each id."""

    def __init__(self, channel: str):
        self.link = CanLink(CanInterface(channel=channel), [0x200, 0x1FF, 0x320])
        self.link.open()
        self.currents, self.duties, self.driven, self._end = {}, [], False, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        begin, k = time.monotonic(), 0
        while not self._end.is_set():
            self.link.send(codec.encode(f"MotorFeedback{i}", angle=100 * i, speed=0, current=0.05) for i in range(1, 7))
            self.link.send(
                [
                    codec.encode("BoardStatus", **STATUS),
                    codec.encode("ImuAccelerometer", x=0, y=k % 5, z=5460, sequence=k % 256),
                    codec.encode("ImuGyroscope", x=0, y=0, z=k % 3, sequence=k % 256),
                    codec.encode("ImuTime", time=int(1e6 * (time.monotonic() - begin)), temperature=40.0, sequence=k % 256),
                ]
            )
            k += 1
            for frame in self.link.receive(0.01):
                if frame.arbitration_id == 0x320:
                    self.duties.append(codec.decode(frame).values.duty)
                else:
                    self.currents[frame.arbitration_id] = bytes(frame.data)
                    self.driven |= bytes(frame.data) != ZERO

    def close(self):
        self._end.set()
        self._thread.join()
        self.link.close()


class Bench:
    """The node's process, the board, and a listener."""

    def __init__(self, *parameters: str):
        channel = private_channel()
        self.board = Board(channel)
        options = [part for p in (f"channel:={channel}", *parameters) for part in ("-p", p)]
        self.process = subprocess.Popen([sys.executable, "-m", "gravcomp_hw.can_bridge", "--ros-args", *options])
        rclpy.init()
        self.node = rclpy.create_node("listener")
        self.heard = {}
        for kind, topic, qos in (
            (Imu, "imu/data_raw", SENSOR), (Temperature, "imu/temperature", SENSOR), (CableState, "cable/state", COMMAND),
            (JointState, "joint_states", 10),
        ):  # fmt: skip
            self.node.create_subscription(kind, topic, lambda m, t=topic: self.heard.update({t: m}), qos)
        self.commands = self.node.create_publisher(CableCommand, "cable/command", COMMAND)
        self.heater = self.node.create_publisher(Float32, "imu/heater", COMMAND)

    def until(self, condition, what, each=lambda: None):
        deadline = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < deadline, what
            each()
            rclpy.spin_once(self.node, timeout_sec=0.01)

    def drive(self):
        """Publish a command with an expected tension, so that the currents are not zero."""
        imu = self.heard.get("imu/data_raw")
        if imu is not None:
            self.commands.publish(CableCommand(header=imu.header, displacement=[0.0] * 6, tension=[0.5] * 6))

    def state(self):
        state = self.heard.get("cable/state")
        return None if state is None else state.state

    def follow(self):
        self.until(lambda: self.state() == CableState.ACTIVE and self.board.driven, "the bridge does not drive", self.drive)

    def call(self, service):
        client = self.node.create_client(Trigger, f"can_bridge/{service}")
        assert client.wait_for_service(10.0)
        future = client.call_async(Trigger.Request())
        self.until(future.done, f"{service} is not answered")
        return future.result()

    def close(self):
        self.process.kill()
        self.process.wait()
        self.node.destroy_node()
        rclpy.try_shutdown()
        self.board.close()


@pytest.fixture
def bench(request):
    bench = Bench(*getattr(request, "param", ()))
    yield bench
    bench.close()


@pytest.fixture(scope="class")
def running():
    bench = Bench()
    yield bench
    bench.close()


class TestRunning:
    """One process for the tests that leave it running and following commands."""

    def test_samples_states_and_services_are_those_of_the_table(self, running):
        running.follow()
        running.until(lambda: len(running.heard) == 4, "a topic is missing")
        imu, state, joints = (running.heard[t] for t in ("imu/data_raw", "cable/state", "joint_states"))
        assert imu.header.frame_id == "imu_link" and imu.orientation_covariance[0] == -1.0
        assert imu.linear_acceleration.z == pytest.approx(9.80665, rel=1e-6)
        assert running.heard["imu/temperature"].temperature == 40.0
        assert list(joints.name) == ["s1c1", "s1c2", "s1c3", "s2c1", "s2c2", "s2c3"] and len(state.displacement) == 6
        assert all(t >= 0 for t in state.tension)

        answer = running.call("stop")
        assert answer.success and "resume" in answer.message
        running.until(lambda: running.state() == CableState.STOPPED, "not stopped", running.drive)
        # The board's thread reads the last frame with a delay.
        running.until(lambda: set(running.board.currents.values()) == {ZERO}, "the currents are not zero")
        assert running.call("resume").success
        running.follow()

    def test_the_heater_follows_its_topic(self, running):
        running.until(
            lambda: 0.25 in running.board.duties, "no heater command", lambda: running.heater.publish(Float32(data=0.25))
        )
        running.until(lambda: running.board.duties[-1] == 0.0, "the heater stays on without commands")

    def test_a_hostile_command_holds_and_does_not_end_the_node(self, running):
        running.follow()
        bad = CableCommand(displacement=[float("nan")] * 6)
        running.until(lambda: running.state() == CableState.HOLDING, "not holding", lambda: running.commands.publish(bad))
        assert "not a number" in running.heard["cable/state"].message
        running.follow()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_without_current_and_with_code_0(bench, number):
    bench.follow()
    bench.process.send_signal(number)
    assert bench.process.wait(15.0) == 0
    bench.until(lambda: set(bench.board.currents.values()) == {ZERO}, "the currents are not zero")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGHUP, signal.SIGSEGV, signal.SIGSTOP])
def test_the_guard_zeroes_the_currents_of_a_killed_or_stopped_bridge(bench, number):
    bench.follow()
    bench.process.send_signal(number)
    bench.until(lambda: set(bench.board.currents.values()) == {ZERO}, "the currents are not zero")


@pytest.mark.parametrize("bench", [("zero:=home",)], indirect=True)
def test_without_zero_positions_nothing_is_driven(bench):
    bench.until(lambda: bench.state() == CableState.STOPPED, "not stopped", bench.drive)
    assert "not homed" in bench.heard["cable/state"].message and not bench.board.driven


@pytest.mark.parametrize(
    ("parameter", "complaint"),
    [
        ("channel:=10.0.0.1:80", "not a multicast group"),
        ("interface:=semaphore", "CAN interface 'semaphore' is not available"),
        ("zero:=sometimes", "allowed: one of start, home, home_at_start"),
        ("control_rate:=20.0", "allowed: 200 to 1000 Hz"),
        ("robot:=nobody", "give the path of a robot file"),
        ("chanel:=can0", "unknown parameter 'chanel'"),
    ],
)
def test_bad_parameters_end_the_node_with_one_sentence(parameter, complaint):
    refuses([parameter], complaint)


@pytest.mark.parametrize(
    ("channel", "complaint"),
    [
        ("239.74.163.2:43113", "channel is '239.74.163.2:43113', 1 channels; needed: one each for the buses base, tip"),
        ("239.74.163.2:43113,10.0.0.1:80", "bus 'tip': udp_multicast 10.0.0.1:80 cannot be opened"),
    ],
)
def test_a_bus_that_is_missing_at_the_start_is_named(channel, complaint):
    refuses(["robot:=three_segment", f"channel:={channel}"], complaint)


def refuses(parameters, complaint):
    options = [part for parameter in parameters for part in ("-p", parameter)]
    command = [sys.executable, "-m", "gravcomp_hw.can_bridge", "--ros-args", *options]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.returncode == 2 and complaint in result.stderr and "Traceback" not in result.stderr
