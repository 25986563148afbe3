"""Taking up the backlash on the board: its C code against the host's, and against the virtual robot's motors and gears."""

import ctypes
import dataclasses
import math

import numpy as np
import pytest
from board_bench import blob_of
from virtual_article import article, given

from gravcomp.canbus import c610, codec
from gravcomp.description.drive import Drive
from gravcomp.firmware import requests
from gravcomp.firmware.host_board import MOTOR_BUS, HostBoard
from gravcomp.firmware.host_library import load as library
from gravcomp.firmware.settings import keys, settings_of, word_of
from gravcomp.motors.loop import REST_COUNTS
from gravcomp.motors.take_up import TakeUp
from gravcomp.virtual.draw import draw
from gravcomp.virtual.motors import TICK, MotorBank

SPRING = np.full(6, 100.0)  # N/m: a cable pulls less than what holds its capstan inside the backlash
PLAY = math.radians(0.6) * 0.005  # m
RESTS = 4e-6  # m, within which a position loop is at rest
DT = 2e-3  # s, of the board's own loops


class Way(ctypes.Structure):
    """`gc_way` of core/take_up.h."""

    _fields_ = (("target", ctypes.c_float), ("fastest", ctypes.c_float))


class TakeUpOnBoard:
    """The C code with the parameters of a drive, called as `TakeUp`."""

    def __init__(self, drive: Drive):
        hardware = dataclasses.replace(article()[1], drive=drive)
        self._words = (ctypes.c_uint32 * len(keys()))()
        library().gc_parameters_default(self._words)
        for name, value in settings_of(hardware, between=True).items():
            self._words[keys()[name]] = word_of(name, value)
        self._state, self._step = (ctypes.c_uint64 * 16)(), library().gc_take_up_step
        self._step.restype, self._step.argtypes = Way, (*[ctypes.c_void_p] * 2, *[ctypes.c_float] * 3)
        library().gc_take_up_reset(self._state)

    def step(self, target: float, displacement: float, dt: float) -> Way:
        return self._step(self._state, self._words, target, displacement, dt)


def commanded(seed: int) -> np.ndarray:
    """Targets (t,) in m: jumps, ramps and rests of 0.1 to 1 s, with a tremble, and noise that leads some out of their band."""
    random, parts, last = np.random.default_rng(seed), [], 0.0
    for _ in range(24):
        after = float(random.choice([random.uniform(-1e-3, 1e-3), last + random.uniform(-4e-5, 4e-5)]))
        parts += [np.linspace(last, after, int(random.integers(1, 60))), np.full(int(random.integers(50, 500)), after)]
        last = after
    targets = np.concatenate(parts)
    out_of_band = np.where(random.random(len(targets)) < 0.01, random.choice([-1.4, 1.4], len(targets)) * 0.2 * PLAY, 0.0)
    return targets + out_of_band + random.uniform(-2e-6, 2e-6, len(targets))


@pytest.mark.parametrize(
    ("changes", "at_least"),
    [
        ({}, 5),
        ({"backlash": 0.03, "take_up_time": 0.11, "velocity_limit": 1e-3}, 5),
        ({"displacement_min": -2e-4}, 2),
        ({"take_up_time": 0.0}, 0),
        ({"backlash": 1e-3}, 0),
    ],
    ids=["article", "wide, soon and slow", "little room", "never", "finer than the loop"],
)
def test_the_c_code_goes_the_way_of_the_host(changes, at_least):
    drive = dataclasses.replace(article()[1].drive, **changes)
    host, board = TakeUp(drive, REST_COUNTS * drive.travel_per_count), TakeUpOnBoard(drive)
    rotor, apart, out, was_out = 0.0, 0, 0, False
    random = np.random.default_rng(7)
    for target in commanded(3):
        (wanted, fastest), way = host.step(target, rotor, DT), board.step(target, rotor, DT)
        same = abs(way.target - wanted) < 1e-9 and way.fastest == pytest.approx(fastest or drive.velocity_limit, rel=1e-5)
        apart += not same
        is_out = wanted < target
        out, was_out = out + (is_out and not was_out), is_out
        counts = (0.9 * rotor + 0.1 * wanted) / drive.travel_per_count + random.integers(-3, 4)
        rotor = round(counts) * drive.travel_per_count
    assert out >= at_least and (at_least or not out)
    assert apart <= 2 * out, "a time may end a step earlier in float32"


class Rig:
    """A board that drives the virtual robot's motors to given targets; cables pull `SPRING` from displacement 0 on."""

    def __init__(self, **settings: float):
        robot, self.hardware = article()
        parameters = given()
        motors = dataclasses.replace(parameters.motors, backlash=math.radians(0.6), capstan_radius=0.005)
        true = draw(dataclasses.replace(parameters, motors=motors), robot, self.hardware).motors
        self.motors = MotorBank(true, self.hardware, np.zeros(6), np.random.default_rng(1))
        self.board = HostBoard(settings_of(self.hardware, between=True) | settings, model=blob_of())
        self.now = 0  # ms
        self.run(0.0, 0.0, 20)
        for motor in self.hardware.motors:
            self.board.receive(requests.request("zero", motor.can_id - 1))
        self.board.receive(requests.act("run"))

    def run(self, start: float | np.ndarray, end: float | np.ndarray, milliseconds: int) -> None:
        """Let the loop want displacements of all cables (m, or (8,)) from `start` to `end`; without samples it computes none."""
        no_tension = (ctypes.c_float * 8)()
        for target in np.linspace(start, end, milliseconds // 2):
            targets = (ctypes.c_float * 8)(*np.broadcast_to(target, 8))
            self.now += 2
            self.motors.step(round(0.002 / TICK), np.zeros(6), SPRING)
            for motor, values in zip(self.hardware.motors, self.motors.feedback()):
                self.board.receive(c610.feedback(motor.can_id, **values), MOTOR_BUS)
            library().gc_board_targets(ctypes.c_void_p(self.board._at), targets, no_tension)
            self.board.advance(1000 * self.now)
            for frame in self.board.sent(MOTOR_BUS):
                for number, current in c610.currents_of(*codec.decode(frame)).items():
                    if number <= len(self.motors.commanded):
                        self.motors.commanded[number - 1] = current
            self.board.sent()


def test_the_loop_on_the_board_takes_up_the_backlash_of_motors_that_only_pull_and_a_stop_ends_it():
    rig = Rig(two_way=0b000010)
    rig.run(0.0, 6e-4, 300)
    rig.run(6e-4, 3e-4, 300)
    rig.run(3e-4, 3e-4, 1000)
    beyond = rig.motors.wound - 3e-4
    assert np.abs(np.delete(beyond, 1)).max() < 2 * RESTS
    assert beyond[1] > 0.7 * PLAY

    rig.run(3e-4, 2e-4, 100)
    while rig.motors.wound[0] > 2e-4 - 0.5 * PLAY:
        rig.run(2e-4, 2e-4, 10)
        assert rig.now < 4000, "the motors do not take up the backlash"
    assert rig.motors.commanded.any()
    rig.board.receive(requests.act("stop"))
    rig.run(2e-4, 2e-4, 4)
    assert not rig.motors.commanded.any()


def test_the_motors_of_a_robot_go_out_at_the_same_time_once_all_their_targets_stay():
    rig = Rig()
    rig.run(0.0, 6e-4, 300)
    rig.run(6e-4, 3e-4, 300)
    last = np.full(8, 3e-4)
    for _ in range(6):  # 0.15 of the backlash in 100 ms: no longer within the band of a target that stays
        before, last[0] = last.copy(), last[0] - 0.15 * PLAY
        rig.run(before, last, 100)
        assert rig.motors.wound[1:].min() > 3e-4 - 2 * RESTS, "one goes out while another target still moves"
    went_out = np.zeros(6, dtype=int)
    for _ in range(200):
        rig.run(last, last, 4)
        out = (rig.motors.wound < last[:6] - 2 * RESTS) & (went_out == 0)
        went_out[out] = rig.now
    assert went_out.min() > 0 and np.ptp(went_out) <= 20
