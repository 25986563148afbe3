"""A board on a bench for tests: the firmware's C code on this machine or its image in the emulator, with motors behind it."""

import struct

import can
import numpy as np

from gravcomp.canbus import c610
from gravcomp.firmware import model_blob, model_transfer, requests
from gravcomp.firmware.host_board import HOST_BUS, MOTOR_BUS, HostBoard

STILL = (10, 20, 5460, 1, 2, 3)
SETTINGS = {"wiring": 1, "motors": 0b0101, "current_limit": 1000}
"""Motors 1 and 3 behind the board."""


class Bench:
    """Time runs in steps of 1 ms: sample, frames of motors and host, tick."""

    def __init__(self, board, motors=(1, 3)):
        self.board, self.motors = board, motors
        self.now = 0  # ms
        self.angles = dict.fromkeys(motors, 1000)
        self.speeds = dict.fromkeys(motors, 0)
        self.measured = dict.fromkeys(motors, 0.0)  # A
        self.silent = False  # the IMU
        self.deaf = False
        self.waiting = []  # frames that the host sends in the next step
        self.temperature = 0  # counts from 23 degC
        self.host, self.to_motors = [], []  # frames with the time in ms

    def run(self, milliseconds, host=None, feedback=True):
        """Let time pass; `host` are currents (A) by CAN id, sent every 4 ms."""
        for _ in range(milliseconds):
            self.now += 1
            if self.now % 10 == 0 and not self.silent:
                self.board.sample(STILL, self.temperature, 1000 * self.now)
            if self.deaf:  # the C code has no wires: its bus is off, and nothing comes or leaves
                self.waiting.clear()
            for message in self.waiting:  # the board looks at the bus of the host first
                self.board.receive(message)
            self.waiting.clear()
            if host is not None and self.now % 4 == 0 and not self.deaf:
                self.board.receive(c610.command("MotorCommand1to4", host))
            if feedback and self.now % 2 == 0:
                for motor in self.motors:
                    frame = c610.feedback(motor, self.angles[motor] % 8192, self.speeds[motor], self.measured[motor])
                    self.board.receive(frame, MOTOR_BUS)
            self.board.advance(1000 * self.now)
            sent = self.board.sent(HOST_BUS)
            self.host += [(self.now, frame) for frame in sent if not self.deaf]
            self.to_motors += [(self.now, frame) for frame in self.board.sent(MOTOR_BUS)]

    def wrong_rate(self, wrong):
        """Let the host's bus have half of its rate, or its own again."""
        if isinstance(self.board, HostBoard):
            self.deaf = wrong
            self.board.bus_off(HOST_BUS, wrong)
        else:
            self.board.machine.cans[HOST_BUS].bus_rate = 0.5e6 if wrong else 1e6

    def restart(self, cause=0):
        self.board.restart(cause)
        self.now = 0

    def ask(self, message):
        """Send a request and return the answer, None without one."""
        self.waiting.append(message)
        begin = len(self.host)
        self.run(2)
        return next((a for _, frame in self.host[begin:] if (a := requests.answer_of(frame))), None)

    def transfer(self, steps, lose=lambda message: False, feedback=False):
        """Let a host send a model, without the frames that `lose` names; all answers are in `answers`. Raises as `steps`."""
        self.answers = []
        try:
            messages = next(steps)
            while True:
                begin = len(self.host)
                self.waiting += [message for message in messages if not lose(message)]
                self.run(2, feedback=feedback)
                found = [a for _, frame in self.host[begin:] if (a := model_transfer.answer_of(frame))]
                self.answers += found
                messages = steps.send(found[-1] if found else None)
        except StopIteration:
            pass

    def currents(self, motor=1, since=0):
        """Currents (mA) of a motor with the times (ms) at which they were sent."""
        place = 2 * ((motor - 1) % 4)
        number = 0x200 if motor <= 4 else 0x1FF
        return [
            (time, int.from_bytes(frame.data[place : place + 2], "big", signed=True))
            for time, frame in self.to_motors
            if frame.arbitration_id == number and time > since
        ]

    def last(self, frame_id) -> can.Message:
        return next(frame for _, frame in reversed(self.host) if frame.arbitration_id == frame_id)


def blob_of(modes: int = 4, motion: float = 1.0, law_points: int = 0, branches: int = 0) -> bytes:
    """A whole blob of six cables in one piece each, on modes that shorten none of them; `motion`: of the tip by the modes.

    law_points: points at which a law of rubber adds a little; branches: of a material that creeps.
    """
    pairs, cables, points = modes * (modes + 1) // 2, 6, 2
    section = np.zeros((9, modes))
    section[0, 0], section[1, 1], section[2, 2] = motion, motion, 0.1 * motion
    change = np.zeros((cables, 3, modes))
    for k in range(cables):
        change[k, 2, :2] = 0.05 * np.cos(k * np.pi / 3.0), 0.05 * np.sin(k * np.pi / 3.0)
    settings = np.zeros(model_blob.SETTINGS)
    settings[:14] = 0.1, 10.0, 0.01, 5.0, 20.0, -0.03, 0.03, 0.025, 0.05, 3e-4, 0.02, 1e-4, 4e-3, 0.09
    settings[14:22] = 0.0, 0.0, 0.1, 0.0, 0.0, 1.0, 1.0, 1e-3
    settings[23], settings[27:30] = 1.0, 1.0
    settings[36:40], settings[55:57] = (9.81, 1e-3, 1e-3, 0.05), (35.0, 60.0)
    settings[-12:] = 0.07, 0.05, 4, 1, 2, 3, 4, 5, 6, 0, 0, 0
    tables = (
        np.zeros((modes, pairs)), np.zeros((pairs, cables)), change, np.eye(3, modes), section,
        (0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0), np.tile((0.0, 0.0, 0.1), (cables, 1)), np.zeros((points, 3, modes)),
        np.linspace((0.0, 0.0, 0.0), (0.0, 0.0, 0.1), points), np.full(cables, 0.1), np.full(cables, 1e-4),
        *[np.zeros(cables)] * 3, np.full(cables, 0.05),
        0.3 * np.random.default_rng(3).normal(size=(law_points, modes, 9)),
        np.tile((8.0, 1.0, 0.3, 0.1, 0.05, 0.1), (law_points, 1)),
        np.tile((0.2, 0.98, 0.99), (branches, 1)), settings,
    )  # fmt: skip
    body = b"".join(np.asarray(table, "<f4").tobytes() for table in tables) + bytes(range(cables)) + bytes(2)
    counts = struct.pack("<8I", modes, modes, cables, cables, model_blob.SETTINGS, points, law_points, branches)
    head = struct.pack("<4sIII", model_blob.MAGIC, model_blob.VERSION, 64 + len(body), 0)
    return model_blob.with_crc(head + b"a robot of tests" + counts + body)
