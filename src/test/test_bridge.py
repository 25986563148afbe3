"""States of the bridge: every cause leads in time to the state in the table of gravcomp_hw/README.md, without a restart."""

import dataclasses
import math
import random

import can
import pytest
from motor_bench import HARDWARE, STEP, Bench, bench_that_follows

from gravcomp.canbus import codec
from gravcomp.description.hardware import Hardware
from gravcomp.motors.state import DRIVING, State

GOAL = [0.001, -0.002, 0.003, -0.004, 0.0015, 0.0]


def following(hardware: Hardware = HARDWARE) -> Bench:
    return bench_that_follows(GOAL, hardware)


def test_displacement_is_within_20_um_in_steady_state():
    bench = following()
    bench.run(0.5, lambda t: GOAL)
    for motor, goal in zip(bench.motors, GOAL):
        assert motor.displacement == pytest.approx(goal, abs=2e-5)


def test_no_current_before_activation_and_until_all_motors_answer():
    bench = Bench()
    bench.run(0.2)
    bench.bridge.configure()
    bench.run(0.2, lambda t: GOAL)
    bench.bridge.activate(bench.now)
    bench.motors[2].silent = True
    bench.run(0.5, lambda t: GOAL)
    assert bench.bridge.state is State.FAULT and "no feedback from motor 3 (c3)" in bench.bridge.message
    assert bench.largest_current == 0.0
    bench.motors[2].silent = False
    bench.run(0.5, lambda t: GOAL)
    assert bench.bridge.state is State.ACTIVE


def test_the_first_commands_after_activation_do_not_jump():
    bench = Bench().start()
    assert bench.bridge.state is State.HOLDING
    bench.run(0.02, lambda t: [0.01] * 6)
    assert all(abs(motor.displacement) < 0.001 for motor in bench.motors)


# Each: the cause, the state it leads to, the time limit (s), words of the message.
CAUSES = {
    "stale command": (lambda b: b.run(0.3), State.HOLDING, 0.25, "no command from an IMU sample of the last 200 ms"),
    "stale imu": (lambda b: (setattr(b, "imu", False), b.run(0.3, lambda t: GOAL)), State.HOLDING, 0.25, "no good IMU samples"),
    "nan": (lambda b: b.run(0.1, lambda t: [math.nan] * 6), State.HOLDING, 0.05, "not a number"),
    "infinite": (lambda b: b.run(0.1, lambda t: [math.inf] * 6), State.HOLDING, 0.05, "not a number"),
    "too few": (lambda b: b.run(0.1, lambda t: GOAL[:5]), State.HOLDING, 0.05, "5 displacements"),
    "outside": (lambda b: b.run(0.1, lambda t: [0.031] * 6), State.HOLDING, 0.05, "allowed: -30 to 30 mm"),
    "jump": (lambda b: b.run(0.012, lambda t: [0.02] * 6), State.HOLDING, 0.05, "jumps by"),
    "old": (lambda b: (b.bridge.command(GOAL, [], b.now, age=0.4), b.run(0.01)), State.HOLDING, 0.05, "older than 200 ms"),
    "from the future": (
        lambda b: (b.bridge.command(GOAL, [], b.now, age=-3.0), b.run(0.01)),
        State.HOLDING,
        0.05,
        "in the future",
    ),
    "one motor silent": (
        lambda b: (setattr(b.motors[4], "silent", True), b.run(0.3, lambda t: GOAL)),
        State.FAULT,
        0.15,
        "motor 5 (c5)",
    ),
    "bus lost": (lambda b: (b.bridge.bus_lost("unplugged"), b.run(0.01)), State.FAULT, 0.02, "unplugged"),
    "stop": (lambda b: (b.bridge.stop(), b.run(0.01)), State.STOPPED, 0.01, "stop"),
    "stall": (
        lambda b: (setattr(b.motors[1], "blocked", True), b.run(0.6, lambda t: [x + 0.002 * min(1, 10 * t) for x in GOAL])),
        State.FAULT,
        0.55,
        "motor 2 (c2) stalled",
    ),
    "foreign motor": (lambda b: (setattr(b.motors[0], "sent_id", 8), b.run(0.3)), State.FAULT, 0.25, ""),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_every_cause_leads_to_its_safe_state_in_time(cause):
    happen, state, within, message = CAUSES[cause]
    bench = following()
    begin = bench.now
    happen(bench)
    assert bench.since(begin, state) <= within
    assert bench.bridge.state is state and message in bench.bridge.message
    assert (bench.bridge.state in DRIVING) or all(motor.current == 0.0 for motor in bench.motors)


def test_old_commands_from_a_queue_do_not_keep_the_bridge_active():
    """The estimator has died and its last commands still arrive: the 200 ms count from the last IMU sample."""
    bench = following()
    begin = bench.now
    for k in range(1, 8):
        bench.run(0.02)
        bench.bridge.command(GOAL, [], bench.now, age=0.02 * k)
    bench.run(0.2)
    assert 0.19 <= bench.since(begin, State.HOLDING) <= 0.21


@pytest.mark.parametrize(
    "cause", ["stale command", "nan", "infinite", "too few", "outside", "jump", "old", "from the future", "bus lost"]
)
def test_good_commands_recover_from_temporary_causes(cause):
    bench = following()
    CAUSES[cause][0](bench)
    bench.run(0.6, lambda t: GOAL)
    assert bench.bridge.state is State.ACTIVE


@pytest.mark.parametrize("cause", ["stop", "stall"])
def test_after_a_stop_or_a_motor_fault_resume_is_needed(cause):
    bench = following()
    CAUSES[cause][0](bench)
    bench.run(0.5, lambda t: GOAL)
    assert bench.bridge.state not in DRIVING
    bench.motors[1].blocked = False
    assert bench.bridge.resume(bench.now)[0]
    bench.run(0.6, lambda t: GOAL)
    assert bench.bridge.state is State.ACTIVE


def test_zero_is_kept_over_a_short_loss_of_feedback():
    bench = following()
    for motor in bench.motors:
        motor.silent = True
    bench.run(0.5)
    for motor in bench.motors:
        motor.silent = False
    bench.run(2.0, lambda t: GOAL)
    assert [m.displacement for m in bench.motors] == pytest.approx(GOAL, abs=2e-5)


def test_after_a_long_loss_the_zero_is_where_the_cables_are():
    """It is unknown how far the cables moved; with `zero` = start the present position is used."""
    bench = following()
    for motor in bench.motors:
        motor.silent = True
    bench.run(1.5)
    for motor in bench.motors:
        motor.silent = False
    bench.run(0.4)
    assert bench.bridge.state is State.HOLDING
    assert bench.bridge.snapshot().displacement == pytest.approx([0.0] * 6, abs=2e-5)


def test_turns_that_could_not_be_counted_wait_for_the_user_to_decide():
    """A motor was turned by hand while its feedback was missing: its zero may be off by whole turns."""
    bench = following()
    bench.motors[1].silent = True
    bench.run(0.3)
    bench.motors[1].angle += 0.4 * 2 * math.pi / 36
    bench.motors[1].silent = False
    bench.run(1.0, lambda t: GOAL)
    assert bench.bridge.state is State.FAULT and "motor 2 (c2) could not be counted" in bench.bridge.message
    assert "velocity_limit" not in bench.bridge.message
    assert all(motor.current == 0.0 for motor in bench.motors)
    assert bench.bridge.resume(bench.now)[0]
    bench.run(1.0, lambda t: GOAL)
    assert bench.bridge.state is State.ACTIVE
    assert bench.motors[1].displacement == pytest.approx(GOAL[1], abs=2e-5)


def test_a_drive_so_fast_that_its_turns_cannot_be_counted_is_told_how_fast_it_may_be():
    drive = dataclasses.replace(HARDWARE.drive, velocity_limit=0.15, acceleration_limit=2.0)
    bench = following(hardware=dataclasses.replace(HARDWARE, drive=drive))
    for k in range(12):  # there and back by 20 mm, in steps that are not refused
        bench.run(0.04, lambda t, k=k: [0.004 * min(k, 11 - k)] * 6)
    assert bench.bridge.state is State.FAULT and "could not be counted" in bench.bridge.message
    assert "velocity_limit_mm_s, 150" in bench.bridge.message and "65.4 at most" in bench.bridge.message


def test_turns_that_could_not_be_counted_are_uncertain_again_after_homing_was_stopped():
    bench = following()
    bench.motors[1].silent = True
    bench.run(0.3)
    bench.motors[1].angle += 0.4 * 2 * math.pi / 36
    bench.motors[1].silent = False
    bench.run(0.3)
    assert bench.bridge.home(bench.now)[0]
    bench.run(1.0)
    assert bench.bridge.state is State.HOMING
    bench.bridge.stop()
    bench.run(0.1)
    assert bench.bridge.state is State.FAULT and "could not be counted" in bench.bridge.message


def test_frames_that_come_late_and_all_at_once_change_neither_zero_nor_state():
    """A receiver is delayed by 40 ms at full speed. While the turns are in doubt the motors get no current."""
    bench, goal = Bench().start(), [0.01] * 6
    bench.run(0.2, lambda t: goal)
    late = []
    for k in range(80):
        bench.now += STEP
        for motor in bench.motors:
            motor.step()
        if k % 4 == 0:
            late += [motor.feedback() for motor in bench.motors]
    for frame in late[:6]:
        bench.bridge.on_frame(frame, bench.now)
    bench.deliver(bench.bridge.tick(bench.now))
    assert all(motor.current == 0.0 for motor in bench.motors) and bench.bridge.state is State.ACTIVE
    for frame in late[6:]:
        bench.bridge.on_frame(frame, bench.now)
    bench.deliver(bench.bridge.tick(bench.now))
    assert all(motor.current != 0.0 for motor in bench.motors)
    bench.run(1.5, lambda t: goal)
    assert bench.bridge.state is State.ACTIVE
    assert [motor.displacement for motor in bench.motors] == pytest.approx(goal, abs=2e-5)


def test_a_delayed_bridge_waits_for_new_feedback_before_it_drives():
    """The guard has zeroed the currents and the cables may have moved; no current is computed from old feedback."""
    bench = following()
    bench.now += 0.5
    for motor in bench.motors:
        bench.bridge.on_frame(motor.feedback(), bench.now)
    bench.deliver(bench.bridge.tick(bench.now))
    assert bench.bridge.state is State.FAULT and "delayed by 50" in bench.bridge.message
    assert all(motor.current == 0.0 for motor in bench.motors)
    bench.run(1.0, lambda t: GOAL)
    assert bench.bridge.state is State.ACTIVE


def test_during_homing_the_record_has_the_zeros_from_before():
    bench = following()
    before = bench.bridge.zero_record()
    bench.bridge.home(bench.now)
    bench.run(2.0)
    assert bench.bridge.state is State.HOMING
    assert {i: rotor.zero for i, rotor in bench.bridge.zero_record().items()} == {i: rotor.zero for i, rotor in before.items()}


def test_restored_zeros_are_lost_when_the_motors_answer_much_later():
    """The motors had no supply; the positions of the cables are unknown."""
    bench = following()
    record = bench.bridge.zero_record()
    bench.bridge = later = Bench(zero="home").bridge
    later.restore(record)
    later.configure()
    later.activate(bench.now)
    for motor in bench.motors:
        motor.silent = True
    bench.run(2.0)
    for motor in bench.motors:
        motor.silent = False
    bench.run(0.5)
    assert later.state is State.STOPPED and "not homed" in later.message


def test_with_zero_home_an_unknown_zero_waits_for_homing():
    bench = Bench(zero="home").start()
    assert bench.bridge.state is State.STOPPED and "not homed" in bench.bridge.message
    assert bench.largest_current == 0.0


def test_an_encoder_that_jumps_is_a_fault():
    bench = following()
    begin = bench.now
    bench.motors[3].angle += 0.3 * 2 * math.pi / 36
    bench.run(0.05, lambda t: GOAL)
    assert bench.since(begin, State.FAULT) <= 0.05 and "motor 4 (c4)" in bench.bridge.message


def test_a_motor_wired_the_wrong_way_round_is_stopped():
    """The feedback has the opposite sign of the currents, so the loop drives away from its setpoint."""
    bench = Bench()
    bench.motors[0].feedback = lambda: mirrored(bench.motors[0])
    bench.start()
    bench.run(1.0, lambda t: GOAL)
    assert bench.bridge.state is State.FAULT and "motor 1 (c1)" in bench.bridge.message
    assert all(motor.current == 0.0 for motor in bench.motors)


def mirrored(motor):
    values = codec.decode(type(motor).feedback(motor)).values
    return codec.encode(f"MotorFeedback{motor.sent_id}", angle=8191 - values.angle, speed=-values.speed, current=values.current)


def test_a_bridge_that_is_activated_again_has_its_zeros_although_the_cables_were_moved():
    bench = following()
    bench.bridge.deactivate()
    bench.deliver(bench.bridge.zero_frames())
    for _ in range(500):
        bench.motors[2].angle += 2e-3
        bench.run(0.002)
    bench.bridge.activate(bench.now)
    bench.run(0.4)
    assert bench.bridge.state is State.HOLDING
    assert bench.bridge.snapshot().displacement == pytest.approx([m.displacement for m in bench.motors], abs=2e-5)


@pytest.mark.slow
def test_homing_finds_where_the_cables_become_taut():
    bench = Bench(motors={"taut": 0.004}).start()
    assert bench.bridge.home(bench.now)[0]
    bench.run(40.0)
    assert bench.bridge.state is State.HOLDING, bench.bridge.message
    assert [m.displacement for m in bench.motors] == pytest.approx([0.004] * 6, abs=1e-4)
    assert bench.bridge.report.count("of slack removed") == 6 and "c1: +4.0" in bench.bridge.report
    assert bench.bridge.snapshot().displacement == pytest.approx([0.0] * 6, abs=2e-5)


def test_homing_that_would_pull_more_than_is_allowed_is_refused():
    homing = dataclasses.replace(HARDWARE.homing, tension_max=2.0)
    bench = Bench(dataclasses.replace(HARDWARE, homing=homing), zero="home_at_start").start()
    assert bench.bridge.state is State.STOPPED and "2.16 N before it counts as taut" in bench.bridge.message
    accepted, why = bench.bridge.home(bench.now)
    assert not accepted and "2 N are allowed" in why and bench.largest_current == 0.0


def test_homing_a_broken_cable_fails_and_keeps_the_old_zero():
    bench = following()
    bench.motors[0].taut = 1.0
    bench.bridge.home(bench.now)
    bench.run(15.0)
    assert bench.bridge.state is State.FAULT and "c1 was wound in by 30 mm" in bench.bridge.message
    assert bench.bridge.snapshot().displacement[0] == pytest.approx(bench.motors[0].displacement, abs=2e-5)


def test_release_pays_out_and_leaves_no_current():
    bench = following()
    assert bench.bridge.release(bench.now)[0]
    bench.run(3.0, lambda t: GOAL)
    assert bench.bridge.state is State.STOPPED and all(motor.current == 0.0 for motor in bench.motors)
    assert all(motor.displacement == pytest.approx(-0.03, abs=2e-3) for motor in bench.motors)


def test_a_later_run_continues_with_the_zeros_of_an_earlier_one():
    bench = following()
    record = bench.bridge.zero_record()
    later = Bench().bridge
    later.restore(record)
    bench.bridge = later
    bench.start()
    assert later.snapshot().displacement == pytest.approx([m.displacement for m in bench.motors], abs=1e-6)


def test_restored_zeros_are_used_although_motors_answered_before():
    bench = following()
    record = bench.bridge.zero_record()
    bench.bridge = later = Bench().bridge
    later.configure()
    bench.run(0.2)
    later.restore(record)
    later.activate(bench.now)
    bench.run(0.5)
    assert later.state is State.HOLDING
    assert later.snapshot().displacement == pytest.approx([m.displacement for m in bench.motors], abs=1e-5)


def test_hostile_frames_and_commands_never_raise_nor_exceed_the_limit():
    random.seed(11)
    bench = following()
    wild = [math.nan, math.inf, -math.inf, 1e308, -1.0, 0.0, 0.02, 1e-9]
    for _ in range(300):
        for _ in range(20):
            frame = can.Message(
                arbitration_id=random.choice([*range(0x1FF, 0x20A), random.randrange(1 << 11)]),
                is_extended_id=random.random() < 0.05,
                data=random.randbytes(random.randint(0, 8)),
            )
            bench.bridge.on_frame(frame, bench.now)
        bench.bridge.command(
            [random.choice(wild) for _ in range(random.randint(0, 8))],
            [random.choice(wild) for _ in range(random.choice((0, 6, 7)))],
            bench.now,
            age=random.choice([0.0, math.nan, -1e9, 1e9]),
        )
        random.choice(
            [bench.bridge.stop, lambda: bench.bridge.resume(bench.now), lambda: bench.bridge.home(bench.now)] + [lambda: None] * 9
        )()
        bench.run(0.01, lambda t: GOAL)
    assert bench.largest_current <= HARDWARE.drive.current_limit
