"""The board's firmware, as C code on this machine and as the image in the emulator: limits, safety, parameters, bad input."""

import itertools
import random

import can
import pytest
from board_bench import SETTINGS, Bench

from gravcomp.canbus.codec import decode, encode
from gravcomp.firmware import requests
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.host_board import HostBoard
from gravcomp.firmware.settings import FAULTS, REAL, STATES, keys, value_of

KINDS = {"host": HostBoard, "image": ImageBoard}


@pytest.fixture(params=KINDS)
def bench(request):
    def make(**settings):
        return Bench(KINDS[request.param](SETTINGS | settings))

    return make


def fault(words: str) -> int:
    return 1 << next(bit for bit, text in enumerate(FAULTS) if text.startswith(words))


def state_of(bench) -> str:
    return STATES[int(decode(bench.last(requests.STATE_ID)).values.state)]


def test_currents_pass_within_the_limit_and_only_to_motors_that_exist_and_answer(bench):
    b = bench()
    b.run(200, {1: 0.3, 2: 0.7, 3: -4.0})
    assert b.currents(1)[-1][1] == 300
    assert b.currents(2)[-1][1] == 0
    assert b.currents(3)[-1][1] == -1000
    values = decode(b.last(requests.STATE_ID)).values
    assert state_of(b) == "following" and values.clamped == 0b100 and values.faults & fault("a current was limited")
    silent = bench()
    silent.run(200, {1: 0.3}, feedback=False)
    assert {current for _, current in silent.currents(1)} == {0}
    assert silent.board.faults & fault("a motor does not answer")


def test_feedback_reaches_the_host_unchanged(bench):
    b = bench()
    b.angles[3] = 4321
    b.run(20)
    assert decode(b.last(0x203)).values.angle == 4321


def test_a_cable_at_the_end_of_its_stroke_is_not_driven_farther(bench):
    b = bench(displacement_max=0.001, displacement_min=-0.001, travel_per_count=1e-6)
    b.run(20, {1: 0.2})
    assert b.ask(requests.request("zero", 0, 900)).done
    b.run(20, {1: 0.2})
    assert b.currents(1)[-1][1] == 200
    b.angles[1] += 200  # 1.1 mm
    b.run(20, {1: 0.2})
    assert b.currents(1)[-1][1] == 0 and b.board.faults & fault("a cable is at the end")
    b.run(20, {1: -0.2})
    assert b.currents(1)[-1][1] == -200


def test_a_motor_that_gets_too_much_current_for_long_is_limited_to_what_it_bears(bench):
    b = bench(current_limit=2000, current_continuous=500, heating_time=2000)
    b.run(100, {1: 2.0})
    assert b.currents(1)[-1][1] == 2000
    b.run(100, {1: 2.0})
    assert b.currents(1)[-1][1] == 500


def test_a_dead_host_is_held_and_released_within_100_ms(bench):
    b = bench()
    b.run(400, {1: 0.4, 3: 0.2})
    dead = b.now - b.now % 4
    b.run(200)
    assert state_of(b) == "released" and b.board.faults & fault("the host stopped")
    after = b.currents(1, since=dead + 1)
    released = next(time for time, current in after if current == 0)
    assert released - dead <= 100
    assert all(current == 0 for time, current in after if time >= released) and len(after) > 15
    held = [current for time, current in after if dead + 52 < time < released]
    assert held and all(abs(current - 400) < 50 for current in held)  # the cable rests, so the current stays
    b.run(100, {1: 0.1})
    assert b.currents(1)[-1][1] == 100


def test_a_board_on_the_motors_own_bus_sends_zeros_when_the_host_has_died(bench):
    b = bench(wiring=0)
    b.run(400, {1: 0.4})
    dead = b.now - b.now % 4
    b.run(1500)
    zeros = [time for time, frame in b.host if frame.arbitration_id == 0x200 and time > dead]
    assert 85 <= zeros[0] - dead <= 100 and zeros[-1] - dead < 1200
    assert all(not any(frame.data) for time, frame in b.host if frame.arbitration_id == 0x200)
    assert state_of(b) == "idle"


def test_a_restart_sends_zeros_at_once(bench):
    b = bench()
    b.run(100, {1: 0.4})
    assert b.ask(requests.request("act", 1)).done
    assert b.ask(requests.save()).done
    for cause, words in ((2, "the last reset came from the watchdog"), (1, "the supply")):
        b.restart(cause)
        b.to_motors.clear()
        b.run(20)
        assert b.currents(1)[0] == (1, 0)
        assert b.board.faults & (fault(words) if cause == 2 else fault("the last reset came from the supply"))


def test_the_heater_is_off_within_two_seconds_of_a_sensor_that_fails(bench):
    for wrong in ("silent", "implausible"):
        b = bench()
        b.run(300)
        for _ in range(20):
            b.board.receive(encode("HeaterCommand", duty=0.5, sequence=0))
            b.run(20)
        assert b.board.duty == pytest.approx(0.5)
        b.silent, b.temperature = wrong == "silent", -1024 if wrong == "implausible" else 0
        for _ in range(95):
            b.board.receive(encode("HeaterCommand", duty=0.5, sequence=0))
            b.run(20)
        assert b.board.duty == 0.0 and b.board.faults & fault("no valid temperature")


def test_the_heater_keeps_its_own_limits(bench):
    b = bench(heater_limit=3000, heater_hot=50)
    b.run(300)
    b.board.receive(encode("HeaterCommand", duty=0.9, sequence=0))
    b.run(10)
    assert b.board.duty == pytest.approx(0.3)
    b.temperature = 8 * (50 - 23) + 1
    b.run(20)
    assert b.board.duty == 0.0 and b.board.faults & fault("too hot")
    b.temperature = 8 * (45 - 23)
    b.run(20)
    assert b.board.duty == pytest.approx(0.3)
    b.run(510)
    assert b.board.duty == 0.0


def test_parameters_are_read_written_and_refused_by_range_key_state_and_board(bench):
    b = bench()
    b.run(10)
    assert b.ask(requests.write("current_limit", 500)).done
    assert b.ask(requests.read("current_limit")).value == 500
    for message, result in (
        (requests.write("current_limit", 10001), "out of range"),
        (requests.request("write", keys()["position_gain"], 0x7FC00000), "out of range"),  # NaN
        (requests.request("write", 200, 1), "unknown key"),
        (requests.request("read", 0x7F), "unknown key"),
        (requests.request("zero", 1, 0), "unknown key"),  # a motor that does not exist
        (requests.request("save", value=1), "out of range"),
        (requests.act("run"), "not in this state"),  # without a loop on the board
    ):
        assert b.ask(message).result == result
    assert b.ask(requests.read("current_limit")).value == 500
    assert b.ask(requests.read("current_limit", board=3)) is None
    assert b.ask(requests.write("board_number", 3)).done
    assert b.ask(requests.read("current_limit", board=3)).board == 3
    b.run(50, {1: 0.1})
    assert b.ask(requests.write("current_limit", 900)).result == "not in this state"
    wrong_check = can.Message(arbitration_id=0x322, is_extended_id=False, data=bytes([3, 1, 0, 0, 0, 0, 0, 0]))
    assert b.ask(wrong_check) is None and b.ask(requests.read("rejected", board=3)).value >= 1


def test_the_shipped_values_of_all_parameters_are_in_their_ranges():
    board = HostBoard()
    for name in keys():
        board.set({name: value_of(name, board.word(name))})
    assert REAL <= set(keys())


def test_saved_parameters_come_back_and_a_supply_lost_at_any_word_leaves_the_last_whole_ones(bench):
    b = bench()
    b.run(10)
    assert b.ask(requests.write("current_limit", 111)).done and b.ask(requests.save()).done
    b.restart()
    assert b.board.word("current_limit") == 111 and not b.board.faults & fault("no stored")
    words = len(keys()) + 4
    for lost in (0, 1, 2, 3, 5, words - 2, words - 1):
        b.run(10)
        assert b.ask(requests.write("current_limit", 222)).done
        b.board.lose_supply_after(lost)
        b.board.receive(requests.save())
        b.run(2)
        b.board.lose_supply_after(-1)
        b.restart(1)
        assert b.board.word("current_limit") == 111, lost
    b.run(10)
    assert b.ask(requests.write("current_limit", 333)).done and b.ask(requests.save()).done
    b.restart()
    assert b.board.word("current_limit") == 333


def test_two_boards_of_one_number_fall_silent_and_say_so(bench):
    b = bench()
    b.run(400)
    other = encode("ImuAccelerometer", x=0, y=0, z=5460, sequence=1)
    for _ in range(5):
        b.board.receive(other)
        b.run(10)
    begin = len(b.host)
    b.run(200)
    ids = {frame.arbitration_id for _, frame in b.host[begin:]}
    assert not ids & {0x310, 0x311, 0x312, 0x313} and requests.STATE_ID in ids
    assert b.board.faults & fault("another board")
    b.run(1200)
    assert not b.board.faults & fault("another board") and b.last(0x310)


def test_a_bus_that_is_off_counts_as_a_dead_host_and_recovers(bench):
    b = bench()
    b.run(300, {1: 0.4})
    b.board.bus_off(0, True)
    dead = b.now
    b.run(200)
    assert b.board.faults & fault("a bus is off") and b.currents(1)[-1][1] == 0
    assert next(time for time, current in b.currents(1, since=dead) if current == 0) - dead <= 100
    b.board.bus_off(0, False)
    b.run(300, {1: 0.2})
    assert b.currents(1)[-1][1] == 200 and not b.board.faults & fault("a bus is off")


def test_homing_on_the_board_fails_without_motors_and_stops_when_a_cable_never_gets_taut(bench):
    b = bench()
    b.run(10, feedback=False)
    assert b.ask(requests.act("home")) .result == "a motor does not answer"
    b = bench()
    b.run(50)
    assert b.ask(requests.act("home")).done
    b.run(400)  # the rotors do not move: lag or stall
    assert state_of(b) == "fault" and b.board.faults & fault("a motor stalled") and b.currents(1)[-1][1] == 0
    assert b.ask(requests.act("resume")).done
    b.run(120)
    assert state_of(b) == "released"


def test_host_and_image_send_the_same_frames_byte_by_byte():
    random_ = random.Random(5)
    benches = [Bench(kind(SETTINGS)) for kind in KINDS.values()]
    for k in range(60):
        messages = [hostile(random_, k) for _ in range(3)]
        pause = random_.choice((1, 7, 40, 130))
        host = random_.choice((None, {1: 0.3, 3: -0.2}, {1: 2.0}))
        angle = random_.randrange(-300, 300)
        for b in benches:
            b.angles[1] += angle
            b.waiting += messages
            b.run(pause, host)
    first, second = ([(t, f.arbitration_id, bytes(f.data)) for t, f in b.host if t > 200] for b in benches)
    assert len(first) > 1000 and first == second
    first, second = ([(t, f.arbitration_id, bytes(f.data)) for t, f in b.to_motors] for b in benches)
    assert len(first) > 300 and first == second


def hostile(random_: random.Random, k: int) -> can.Message:
    """A frame that may be whole, changed, or noise."""
    kind = random_.randrange(4)
    if kind == 0:
        return can.Message(
            arbitration_id=random_.choice((0x1FF, 0x200, 0x201, 0x320, 0x322, 0x328, random_.randrange(0x800))),
            is_extended_id=False,
            data=random_.randbytes(random_.randrange(9)),
        )
    if kind == 1:
        return requests.request("write", random_.randrange(256), random_.randrange(1 << 32))
    if kind == 2:
        return encode("HeaterCommand", duty=random_.random(), sequence=k % 256)
    return requests.request("read", random_.choice((*range(len(keys())), *range(0x80, 0x88), *range(0x89, 0xA1))))


def test_all_pairs_of_operations_are_answered_once(bench):
    b = bench()
    b.run(150)
    for operation, key in itertools.product(("read", "write", "forget", "zero"), (0, 2, 0x90)):
        begin = len(b.host)
        b.board.receive(requests.request(operation, key, 5))
        b.run(2)
        assert sum(frame.arbitration_id == requests.REPLY_ID for _, frame in b.host[begin:]) == 1
