"""The board's firmware, as C code on this machine and as the image in the emulator: limits, safety, parameters, bad input."""

import copy
import itertools
import random

import can
import pytest
from board_bench import SETTINGS, Bench

from gravcomp.canbus.codec import decode, encode
from gravcomp.firmware import requests
from gravcomp.firmware.campaign import attack
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.fuzzing import fuzz
from gravcomp.firmware.host_board import HostBoard
from gravcomp.firmware.image import build_image
from gravcomp.firmware.settings import FAULTS, REAL, STATES, keys, value_of
from gravcomp.firmware.stack import INTERRUPT_FRAME, largest_stack

pytestmark = pytest.mark.slow

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
    for cause, words in ((2, "the last reset came from the watchdog"), (1, "the supply is too low, or caused")):
        b.restart(cause)
        b.to_motors.clear()
        b.run(20)
        assert b.currents(1)[0] == (1, 0)
        assert b.board.faults & fault(words)


def test_the_heater_is_off_within_two_seconds_of_a_sensor_that_fails(bench):
    for wrong in ("silent", "implausible"):
        b = bench()
        b.run(300, feedback=False)
        b.board.receive(encode("HeaterCommand", duty=0.5, sequence=0))
        b.run(20, feedback=False)
        assert b.board.duty == pytest.approx(0.5)
        b.silent, b.temperature = wrong == "silent", -1024 if wrong == "implausible" else 0
        for _ in range(5):
            b.board.receive(encode("HeaterCommand", duty=0.5, sequence=0))
            b.run(350, feedback=False)
        assert b.board.duty == 0.0 and b.board.faults & fault("no valid temperature")


def test_the_heater_keeps_its_own_limits(bench):
    b = bench(heater_limit=3000, heater_hot=50)
    b.run(300, feedback=False)
    b.board.receive(encode("HeaterCommand", duty=0.9, sequence=0))
    b.run(10, feedback=False)
    assert b.board.duty == pytest.approx(0.3)
    b.temperature = 8 * (50 - 23) + 1
    b.run(20, feedback=False)
    assert b.board.duty == 0.0 and b.board.faults & fault("too hot")
    b.temperature = 8 * (45 - 23)
    b.run(20, feedback=False)
    assert b.board.duty == pytest.approx(0.3)
    b.run(510, feedback=False)
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
    assert set(keys()) >= REAL


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


def test_a_copy_of_a_board_goes_on_by_itself():
    board = HostBoard(SETTINGS)
    copied = copy.deepcopy(board)
    copied.receive(requests.write("current_limit", 123))
    copied.receive(requests.save())
    assert (copied.word("current_limit"), board.word("current_limit")) == (123, 1000)
    for one in (copied, board):
        one.restart()
    assert (copied.word("current_limit"), board.word("current_limit")) == (123, 1000)


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


def test_a_bus_of_the_wrong_rate_is_a_bus_without_a_host_until_the_rates_agree(bench):
    b = bench()
    b.run(300, {1: 0.4})
    dead = b.now
    b.wrong_rate(True)
    b.run(200, {1: 0.4})
    assert b.board.faults & fault("a bus is off") and b.currents(1)[-1][1] == 0
    assert next(time for time, current in b.currents(1, since=dead) if current == 0) - dead <= 100
    assert not [frame for time, frame in b.host if time > dead + 1]
    b.wrong_rate(False)
    b.run(300, {1: 0.2})
    assert b.currents(1)[-1][1] == 200 and not b.board.faults & fault("a bus is off") and b.last(0x310)


def test_homing_on_the_board_fails_without_motors_and_stops_when_a_cable_never_gets_taut(bench):
    b = bench()
    b.run(10, feedback=False)
    assert b.ask(requests.act("home")).result == "a motor does not answer"
    b = bench()
    b.run(50)
    assert b.ask(requests.act("home")).done
    b.run(400)  # the rotors do not move: lag or stall
    assert state_of(b) == "fault" and b.board.faults & fault("a motor stalled") and b.currents(1)[-1][1] == 0
    assert not b.ask(requests.act("home")).done and b.ask(requests.act("stop")).done and not b.ask(requests.act("run")).done
    b.run(120)
    assert state_of(b) == "fault" and b.currents(1)[-1][1] == 0  # only resume ends it
    assert b.ask(requests.act("resume")).done
    b.run(120)
    assert state_of(b) == "released"


class Cables:
    """Two rotors with friction that wind cables in, each taut from its own position on; 1 count is 1 um."""

    def __init__(self, bench, taut):
        self.bench, self.taut = bench, taut  # m by motor, from where the rotor starts
        self.position = dict.fromkeys(taut, 0.0)

    def run(self, milliseconds):
        for _ in range(milliseconds // 2):
            for motor, taut in self.taut.items():
                sent = self.bench.currents(motor)
                current = 1e-3 * sent[-1][1] if sent else 0.0
                load = 0.05 + 60.0 * max(0.0, self.position[motor] - taut)
                velocity = 0.1 * (max(0.0, current - load) + min(0.0, current + 0.05))
                self.position[motor] += 0.002 * velocity
                self.bench.angles[motor] = 1000 + round(1e6 * self.position[motor])
                self.bench.speeds[motor] = round(1e6 * velocity * 60 / 8192)
                self.bench.measured[motor] = current
            self.bench.run(2)
            del self.bench.to_motors[:-4]


def test_homing_on_the_board_finds_where_each_cable_gets_taut():
    b = Bench(HostBoard(SETTINGS | {"travel_per_count": 1e-6, "velocity_gain": 20.0, "velocity_integral": 300.0}))
    cables = Cables(b, {1: 0.002, 3: -0.001})
    b.run(20)
    assert b.ask(requests.act("home")).done
    for _ in range(80):
        cables.run(200)
        if state_of(b) != "homing":
            break
    assert state_of(b) == "holding" and not b.board.faults & fault("homing")
    for motor, taut in cables.taut.items():
        assert b.ask(requests.request("read", requests.ZERO_KNOWN + motor - 1)).value == 1
        counts = b.ask(requests.request("read", requests.DISPLACEMENT + motor - 1)).value
        counts -= (counts >> 31) << 32
        # Of the displacement from zero that the board reports: within 0.1 mm of where the cable is in truth.
        assert counts == pytest.approx(1e6 * (cables.position[motor] - taut), abs=100)
    assert b.ask(requests.act("run")).result == "not in this state"  # there is no loop on this board


def test_homing_of_a_cable_that_is_unhooked_fails():
    b = Bench(
        HostBoard(
            SETTINGS | {"travel_per_count": 1e-6, "homing_travel": 0.004, "velocity_gain": 20.0, "velocity_integral": 300.0}
        ),
        motors=(1,),
    )
    b.board.set({"motors": 1})
    cables = Cables(b, {1: 1.0})
    b.run(20)
    assert b.ask(requests.act("home")).done
    for _ in range(40):
        cables.run(200)
    assert state_of(b) == "fault" and b.board.faults & fault("homing failed")


def test_a_robot_without_a_pc_homes_when_its_motors_answer():
    b = Bench(HostBoard(SETTINGS | {"at_start": 1}))
    b.run(900)
    assert state_of(b) == "released"
    b.run(300)
    assert state_of(b) in ("homing", "fault") and b.currents(1, since=1000)


def test_an_image_that_is_not_whole_does_not_run():
    image = build_image()
    for part, at in (("code", 100), ("boot", len(image.boot) - 8)):
        board = ImageBoard(image=image)
        whole = {"boot": image.boot, "code": image.code}
        broken = bytearray(whole[part])
        broken[at] ^= 1
        board.machine.load(**(whole | {part: bytes(broken)}))
        board.restart()
        assert board.machine.dead
    board.machine.load(image.boot, image.code[: len(image.code) // 2])  # the supply was lost while it was written
    board.restart()
    assert board.machine.dead
    board.machine.load(image.boot, image.code)
    board.restart()
    assert not board.machine.dead


def test_the_watchdog_resets_an_image_whose_main_loop_stands_still():
    b = Bench(ImageBoard(SETTINGS))
    b.run(10)
    assert b.ask(requests.save()).done
    b.run(100, {1: 0.3})
    b.board.machine.main_stands = True
    begin = b.now
    while len(b.board.machine.resets) == 1 and b.now < begin + 200:
        b.run(1, {1: 0.3})
    # 40 ms until the tick no longer feeds it, 40 ms of the watchdog.
    assert b.board.machine.resets == ["power", "watchdog"] and b.now - begin <= 85
    b.board.machine.main_stands, b.now = False, 0
    b.to_motors.clear()
    b.run(20)
    assert b.currents(1)[0][1] == 0 and b.board.faults & fault("the last reset came from the watchdog")


def test_the_image_sets_the_bit_rate_and_lets_go_when_the_supply_falls():
    b = Bench(ImageBoard(SETTINGS))
    assert [can_.bit_rate for can_ in b.board.machine.cans] == [1e6, 1e6]
    b.run(300, {1: 0.3})
    b.board.receive(encode("HeaterCommand", duty=0.5, sequence=0))
    b.run(20, {1: 0.3})
    assert b.board.duty == 0.5
    b.board.machine.supply_low = True
    b.run(20, {1: 0.3})
    assert b.board.duty == 0.0 and b.currents(1)[-1][1] == 0 and b.board.faults & fault("the supply is too low")
    assert not b.ask(requests.act("home")).done and b.currents(1)[-1][1] == 0


def test_frames_that_come_faster_than_the_tick_takes_them_are_reported():
    b = Bench(ImageBoard(SETTINGS))
    b.run(20)
    for _ in range(100):
        b.board.receive(encode("HeaterCommand", duty=0.0, sequence=0))
    b.run(2)
    assert b.board.faults & fault("frames were lost") and b.ask(requests.read("dropped")).value == 100 - 63


def test_the_stack_that_is_used_is_within_the_bound():
    image = build_image()
    bound = largest_stack(image)
    b = Bench(ImageBoard(SETTINGS, image=image))
    b.run(300, {1: 0.3})
    b.ask(requests.save())
    b.ask(requests.act("home"))
    b.run(100)
    # The emulator calls the handlers without the frames that the processor saves.
    assert 150 < b.board.machine.stack_used <= bound - 2 * INTERRUPT_FRAME < 8192


def test_hostile_frames_change_nothing_that_must_hold():
    outcome = attack(6000, 3)
    assert (outcome.violations, outcome.differences, outcome.faults) == (0, 0, []) and outcome.answers > 100
    found = fuzz(5000, 2)
    assert (found.violations, found.fault) == (0, "") and found.edges > 500


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
