"""The bench test of a board and its parameters over a bus: a board of C code behind python-can's virtual bus, in real time."""

import html
import threading
import time

import can
import numpy as np
import pytest

from gravcomp.canbus import c610
from gravcomp.canbus.codec import decode
from gravcomp.commands.__main__ import main
from gravcomp.config import ConfigError
from gravcomp.description import load_robot_file
from gravcomp.description.hardware import CanInterface
from gravcomp.doctor import board as bench_test
from gravcomp.doctor import board_motor
from gravcomp.doctor.board_page import write_page
from gravcomp.firmware import client as client_module
from gravcomp.firmware.client import BoardClient
from gravcomp.firmware.settings import settings_of, value_of
from gravcomp.virtual.emulated_board import EmulatedBoard
from gravcomp.virtual.parameters import Board

UP = np.array([0.0, 0.0, 9.81])


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    monkeypatch.setattr(client_module, "_PATIENCE", 20.0)  # s: a busy machine answers late


SLOW = 0.2
"""Of real time, in which a board with motors runs: a busy machine is no dead host."""


class FreeMotors:
    """Motors behind a board that have the commanded current, and do not turn."""

    def __init__(self, board, motors):
        self.board, self.current = board, dict.fromkeys(motors, 0.0)

    def run(self):
        for frame in self.board.to_motors():
            values = decode(frame)
            self.current |= {
                motor: i for motor, i in c610.currents_of(values.name, values.values).items() if motor in self.current
            }
        self.board.feedback([c610.feedback(motor, 1000, 0, current) for motor, current in self.current.items()])


@pytest.fixture
def live(request):
    """A board on a bus of its own: the channel, and the board. With the parameter "motors", it has those of the article."""
    channel, ending = request.node.name, threading.Event()
    hardware, motors, pace = None, None, 1.0
    if getattr(request, "param", "") == "motors":
        file = load_robot_file("article")
        hardware = file.hardware
    board = EmulatedBoard(Board(), np.random.default_rng(1), hardware)
    if hardware is not None:
        motors, pace = FreeMotors(board, [motor.can_id for motor in hardware.motors]), SLOW

    def serve():
        begin, samples = time.monotonic(), 0
        with can.Bus(interface="virtual", channel=channel) as bus:
            while not ending.is_set():
                for _ in range(50):
                    message = bus.recv(0.001)
                    if message is None:
                        break
                    board.receive(message)
                now = pace * (time.monotonic() - begin)
                if motors is not None:
                    motors.run()
                if now >= 0.01 * (samples + 1):
                    samples += 1
                    frames = board.sample(np.zeros(3), UP, False)
                else:
                    board.advance(now)
                    frames = board.to_host()
                for frame in frames:
                    bus.send(frame)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield channel, board
    ending.set()
    thread.join(5.0)


def test_the_bench_test_finds_a_good_board_good_and_says_what_is_wrong_with_a_bad_one(live, monkeypatch):
    channel, board = live
    monkeypatch.setattr(bench_test, "_STATE_WAIT", 60.0)
    found = {finding.subject: finding for finding in bench_test.examine("virtual", channel, 1.6)}
    assert set(found) == {"board", "samples", "noise", "delay of answers", "heater", "state"}
    assert "firmware 1.1" in found["board"].found and found["noise"].level == "ok"
    assert "duty 0.50" in found["heater"].found
    board.chip.imu_fault = "silent"
    found = {finding.subject: finding for finding in bench_test.examine("virtual", channel, 0.3)}
    assert found["samples"].level == "missing" and "the IMU does not answer" in found["state"].found


@pytest.mark.parametrize("live", ["motors"], indirect=True)
def test_a_current_step_is_measured_and_the_current_ends_when_the_host_does(live, tmp_path, monkeypatch):
    channel, _ = live
    monkeypatch.setattr(board_motor, "_DEAD", 1.5)
    with BoardClient(CanInterface("virtual", channel)) as client:
        found = {finding.subject: finding for finding in board_motor.examine(client, 2, 0.3)}
        assert found["current step"].found.startswith("0.300 A for 0.300 A (the board's limit:")
        assert "current until" in found["dead host"].found and "until 0 ms" not in found["dead host"].found
        assert board_motor.examine(client, 8, 0.3)[0].level == "missing"  # the robot has six
        with pytest.raises(ConfigError, match=r"--current is 3; allowed: 0\.05 to 1 A"):
            board_motor.examine(client, 2, 3.0)
    page = write_page(list(found.values()), "virtual", channel, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert "gravcomp doctor --board" in text and "is unhooked" in text and html.escape(found["current step"].found) in text


def test_a_board_that_has_run_alone_waits_for_its_host_again(monkeypatch):
    written = {}
    monkeypatch.setattr(BoardClient, "__init__", lambda *_: None)
    monkeypatch.setattr(BoardClient, "__exit__", lambda *_: None)
    monkeypatch.setattr(BoardClient, "configure", lambda _, settings: written.update(settings))
    for option, alone in (["--standalone"], 1), ([], 0):
        assert main(["firmware", "parameters", "article", *option]) == 0
        assert written["at_start"] == written["heater_own"] == alone


def test_the_parameters_of_a_robot_are_written_and_stored(live, monkeypatch):
    channel, board = live
    file = load_robot_file("article")
    hardware = file.hardware
    with BoardClient(CanInterface("virtual", channel)) as client:
        client.configure(settings_of(hardware, between=True))
        board.firmware.restart()
        for name, value in settings_of(hardware, between=True).items():
            assert value_of(name, board.firmware.word(name)) == pytest.approx(value, rel=1e-6)
        with pytest.raises(ConfigError, match="the board refuses current_limit = 99999: out of range"):
            client.configure({"current_limit": 99999})
        client.configure({"board_number": 2})
    monkeypatch.setattr(client_module, "_LISTEN", 2.0)
    monkeypatch.setattr(client_module, "_PATIENCE", 0.2)
    with (
        BoardClient(CanInterface("virtual", channel), 3) as client,
        pytest.raises(ConfigError, match="no board has the number 3; on the bus: 2"),
    ):
        client.value("uptime")


def test_without_a_board_the_bus_is_named(monkeypatch):
    monkeypatch.setattr(client_module, "_PATIENCE", 0.2)
    found = bench_test.examine("virtual", "nobody-is-here", 0.2)
    assert [finding.level for finding in found] == ["missing"] and "no board answers" in found[0].found
    with pytest.raises(ConfigError, match="0 to 15"):
        BoardClient(CanInterface("virtual", "x"), 77)
