"""Taking up the backlash: bridge and position loops against the virtual robot's motors, gears and capstans."""

import copy
import dataclasses
import functools
import math

import numpy as np
import pytest
from virtual_article import article, given

from gravcomp.bench.joint_campaign import with_joints
from gravcomp.canbus import c610, codec
from gravcomp.closed_loop.bridged_joints import BridgedJoints
from gravcomp.description.hardware import Hardware
from gravcomp.description.joint_motors import COMMANDS
from gravcomp.motors.bridge import Bridge
from gravcomp.motors.take_up import TakeUp, act_together
from gravcomp.virtual.draw import draw
from gravcomp.virtual.motors import TICK, MotorBank

SPRING = np.full(6, 100.0)  # N/m: a cable pulls less than what holds its capstan inside the backlash
RESTS = 4e-6  # m, within which a position loop is at rest: 37.5 counts


class Rig:
    """Bridge and virtual motors whose cables pull `SPRING` from the displacement 0 on.

    joints: how the motors are commanded, where they are joints of a ros2_control robot.
    """

    def __init__(self, backlash_deg: float = 0.6, joints: str | None = None, **drive: float):
        robot, hardware = article()
        self.hardware: Hardware = dataclasses.replace(hardware, drive=dataclasses.replace(hardware.drive, **drive))
        parameters = given()
        motors = dataclasses.replace(parameters.motors, backlash=math.radians(backlash_deg), capstan_radius=0.005)
        true = draw(dataclasses.replace(parameters, motors=motors), robot, hardware).motors
        self.motors = MotorBank(true, hardware, np.zeros(6), np.random.default_rng(1))
        self.motor_bridge: Bridge | BridgedJoints
        if joints is None:
            self.bridge = self.motor_bridge = Bridge(self.hardware, require_imu=False)
        else:
            self.motor_bridge = BridgedJoints(with_joints(self.hardware, joints))
            self.bridge = self.motor_bridge.bridge
        self.now, self._step, self.frames = 0.0, 0, []
        self.motor_bridge.configure()
        self.motor_bridge.activate(0.0)
        self.run(0.4, np.zeros(6))

    def run(self, duration: float, command) -> np.ndarray:
        """Command the displacement (6,) in m, or that of a time (s), for a while; return those of the rotors (t, 6) in m."""
        rotors, begin = [], self.now
        for _ in range(round(duration / 0.002)):
            self._step, self.now = self._step + 1, self.now + 0.002
            self.motors.step(round(0.002 / TICK), np.zeros(6), SPRING)
            for motor, values in zip(self.hardware.motors, self.motors.feedback()):
                self.motor_bridge.on_frame(c610.feedback(motor.can_id, **values), self.now)
            if self._step % 5 == 0:
                wanted = command(self.now - begin) if callable(command) else command
                self.motor_bridge.command(list(wanted), [0.0] * 6, self.now)
            if self._step % 2 == 0:
                self._deliver(self.motor_bridge.tick(self.now))
            rotors.append(self.bridge.snapshot().displacement)
        return np.array(rotors)

    def _deliver(self, frames) -> None:
        for frame in frames:
            currents = c610.currents_of(*codec.decode(frame))
            for index, motor in enumerate(self.hardware.motors):
                if motor.can_id in currents:
                    self.motors.commanded[index] = currents[motor.can_id]

    def move(self, start: float, end: float, rest: float) -> np.ndarray:
        """Command all cables from `start` to `end` (m) and let them rest (s); return the rotors (t, 6) meanwhile."""
        self.run(0.3, lambda time: np.full(6, start + (end - start) * min(1.0, time / 0.3)))
        return self.run(rest, np.full(6, end))


@functools.cache
def _paid_out(backlash_deg: float, joints: str | None, take_up_time: float | None) -> Rig:
    rig = Rig(backlash_deg, joints, **({} if take_up_time is None else {"take_up_time": take_up_time}))
    rig.move(0.0, 6e-4, 0.0)
    rig.move(6e-4, 3e-4, 0.0)
    return rig


def paid_out(backlash_deg: float = 0.6, joints: str | None = None, take_up_time: float | None = None) -> Rig:
    """Return a rig whose cables have been wound in by 0.6 mm and paid out to 0.3 mm: a copy of one that is computed once."""
    rig = _paid_out(backlash_deg, joints, take_up_time)
    return copy.deepcopy(rig, {id(rig.hardware): rig.hardware})


@pytest.mark.parametrize("backlash_deg", [0.4, 0.6, 0.8])
def test_a_cable_that_was_paid_out_has_the_commanded_length_whatever_the_backlash_is(backlash_deg):
    rig = paid_out(backlash_deg)
    rig.run(1.0, np.full(6, 3e-4))
    assert np.abs(rig.motors.wound - 3e-4).max() < 2 * RESTS


@pytest.mark.parametrize("joints", COMMANDS)
def test_so_has_one_on_a_joint_of_any_controller(joints):
    rig = paid_out(joints=joints)
    rig.run(1.0, np.full(6, 3e-4))
    assert np.abs(rig.motors.wound - 3e-4).max() < 2 * RESTS


def test_without_it_the_cable_stays_too_short_by_the_backlash():
    rig = paid_out(take_up_time=0.0)
    rig.run(1.0, np.full(6, 3e-4))
    assert (rig.motors.wound - 3e-4).min() > 0.7 * math.radians(0.6) * 0.005


def test_nothing_moves_afterwards_while_the_command_trembles_and_a_hold_or_a_new_command_ends_it():
    rig = paid_out()
    rig.run(1.0, np.full(6, 3e-4))
    taken_up = np.array(rig.bridge.snapshot().displacement)
    rotors = rig.run(0.8, lambda time: np.full(6, 3e-4 + 3e-6 * math.sin(40.0 * time)))
    assert np.abs(rotors - taken_up).max() < 3 * RESTS

    rig.move(3e-4, 2e-4, 0.0)
    while rig.run(0.01, np.full(6, 2e-4))[-1].max() > 1.6e-4:
        assert rig.now < 4.0, "the motors do not take up the backlash"
    rig.bridge._hold("test")
    assert rig.bridge.snapshot().command == [2e-4] * 6
    rotors = rig.run(0.3, np.full(6, 4e-4))
    assert np.abs(rotors[-1] - 4e-4).max() < 0.1e-3, "a new command is followed at once"


@pytest.mark.parametrize("joints", [None, *COMMANDS])
def test_the_motors_of_a_robot_go_out_at_the_same_time_once_all_their_targets_stay(joints):
    """One that pays out alone pushes the tip aside until its antagonist follows."""
    rig, slow = paid_out(joints=joints), 0.5 * math.radians(0.6) * 0.005
    rotors = rig.run(0.8, lambda time: 3e-4 - np.array([slow * time / 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert rotors[:, 1:].min() > 3e-4 - 3 * RESTS
    last = rig.bridge.snapshot().command
    rotors = rig.run(2.4, np.array(last))  # effort controllers need two seconds
    out = rotors < np.array(last) - 0.5 * math.radians(0.6) * 0.005
    assert out.any(axis=0).all() and np.ptp(out.argmax(axis=0)) * 0.002 < 0.05
    assert np.abs(rig.motors.wound - last).max() < 2 * RESTS


def test_motors_whose_targets_have_crept_begin_at_the_same_time():
    """Alone, each would wait for several times as long as its target stayed before."""
    take_ups, began = [TakeUp(article()[1].drive, RESTS) for _ in range(2)], {}
    rotors = [1e-3, 1e-3]
    for step in range(400):
        slow, fast = 12e-6 * min(step / 60, 1.0), 12e-6 * min(max(step - 100, 0) / 30, 1.0)
        targets = [1e-3 if step < 100 else 5e-4 - fast, 1e-3 - slow]
        act_together(take_ups)
        for k, take_up in enumerate(take_ups):
            rotors[k], _ = take_up.step(targets[k], rotors[k], 0.004)
            if take_up.moves:
                began.setdefault(k, step)
    assert began[0] == began[1] < 300


def farthest_beyond(targets: list[float], **drive) -> float:
    """How far a rotor that follows at once goes out beyond the last of its targets (m), which rests for a second."""
    take_up = TakeUp(dataclasses.replace(article()[1].drive, **drive), RESTS)
    rotor, outward = targets[0], 0.0
    for target in targets:
        rotor, _ = take_up.step(target, rotor, 0.004)
    for _ in range(250):
        rotor, _ = take_up.step(targets[-1], rotor, 0.004)
        outward = max(outward, targets[-1] - rotor)
    return outward


def test_only_a_motor_that_has_turned_back_goes_out_and_none_beyond_the_limit_of_its_displacement():
    play = math.radians(0.6) * 0.005
    assert farthest_beyond([1e-3, 5e-4]) > play
    assert farthest_beyond([5e-4, 1e-3]) == 0.0
    assert farthest_beyond([1e-3, 5e-4], displacement_min=5e-4 - play) == 0.0


def test_a_gear_finer_than_the_position_loop_and_a_take_up_that_is_switched_off_move_nothing():
    assert farthest_beyond([1e-3, 5e-4], backlash=math.radians(0.05)) == 0.0
    assert farthest_beyond([1e-3, 5e-4], take_up_time=0.0) == 0.0


def times_taken_up(target, duration: float, **drive) -> int:
    """How often a rotor that follows at once goes out while its target (m) is that function of the time for `duration` s."""
    take_up = TakeUp(dataclasses.replace(article()[1].drive, **drive), RESTS)
    rotor, times, before = target(0.0), 0, False
    for step in range(round(duration / 0.004)):
        rotor, _ = take_up.step(target(0.004 * step), rotor, 0.004)
        times, before = times + (take_up.moves and not before), take_up.moves
    return times


@pytest.mark.parametrize("size", [1.1, 1.9])
@pytest.mark.parametrize("samples", [1, 3])
def test_a_target_that_noise_moves_out_of_its_band_for_some_samples_is_taken_up_once(size, samples):
    band, random = 0.2 * math.radians(0.6) * 0.005, np.random.default_rng(3)
    count = 2500 // samples + 1
    noise = np.repeat((random.random(count) < 0.03) * random.choice([-size, size], count), samples) * band

    def trembles(time: float) -> float:  # the IMU gives a sample every 10 ms
        return 7e-4 + float(noise[int(100 * time)]) if time > 1.0 else 1e-3

    assert times_taken_up(trembles, 24.0) == 1


@pytest.mark.parametrize("rate", [0.03e-3, 0.01e-3, 0.005e-3])
def test_a_target_that_creeps_is_not_at_rest_until_it_stops(rate):
    def crept(time: float) -> float:
        return 1e-3 - rate * min(time, 12.0)

    assert times_taken_up(crept, 12.0) == 0
    assert times_taken_up(crept, 25.0) == 1


@pytest.mark.parametrize("period", [6.0, 20.0])
def test_a_target_that_swings_slowly_does_not_rest_where_it_turns_round(period):
    swing = 0.1e-3
    for late in np.linspace(0.0, 1.0, 7):
        assert times_taken_up(lambda time, late=late: swing * math.sin(2 * math.pi * (time / period + late)), 2 * period) <= 1


def test_a_small_step_after_a_long_rest_is_taken_up_too():
    play = math.radians(0.6) * 0.005
    assert times_taken_up(lambda time: 1e-3 - (0.3 * play if time > 60.0 else 0.0), 80.0) == 1


def test_a_target_that_trembles_toward_the_limit_while_it_is_taken_up_leads_no_motor_beyond_it():
    play, edge = math.radians(0.6) * 0.005, -1e-3
    over = 4.0 / 3.0 * play + 2.0 * RESTS
    take_up = TakeUp(dataclasses.replace(article()[1].drive, displacement_min=edge), RESTS)
    rotor, last, out = edge + 1e-3, edge + over, []
    for step in range(400):
        target = rotor if step == 0 else last - 0.15 * play * take_up.moves
        goal, _ = take_up.step(target, rotor, 0.004)
        rotor += float(np.clip(goal - rotor, -0.2 * play, 0.2 * play))
        out.append(goal)
    assert min(out) == edge
    assert not take_up.moves, "it ends"
