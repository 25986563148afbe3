"""What the board does while a sector of its flash is erased: nothing, for up to two seconds, and nothing unsafe; on the image.

The code of the image is in the same flash, which cannot be read meanwhile. The emulator refuses code of the flash, an open
interrupt and a watchdog that is not fed while it is busy.
"""

import pytest
from board_bench import SETTINGS, Bench, blob_of

from gravcomp.canbus.codec import decode, encode
from gravcomp.firmware import model_transfer, requests
from gravcomp.firmware.emulator.flash_memory import LONGEST_ERASURE
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.settings import STATES

SAVING, SECTOR = (time // 1000 for time in LONGEST_ERASURE)  # ms


def warm(model=None) -> Bench:
    """A board with its heater on, whose host is silent."""
    b = Bench(ImageBoard(SETTINGS, model=model))
    b.board.machine.flash.erasure = LONGEST_ERASURE
    b.run(300, {1: 0.4})
    b.run(200)
    b.board.receive(encode("HeaterCommand", duty=0.5, sequence=0))
    b.run(10)
    assert b.board.duty == 0.5
    return b


def answered(b, limit: int) -> int:
    """Run until the board sends something; return the ms."""
    begin, sent = b.now, len(b.host)
    while len(b.host) == sent and b.now - begin < limit:
        b.run(1)
    return b.now - begin


@pytest.mark.parametrize(("message", "longest"), [(requests.save(), SAVING), (model_transfer.request("erase", sector=0), SECTOR)])
def test_while_a_sector_is_erased_motors_and_heater_are_off_and_nothing_hangs(message, longest):
    b = warm(blob_of() if longest == SECTOR else None)
    if longest == SECTOR:
        b.waiting.append(model_transfer.request("begin", 1000))
        b.run(2)
    b.waiting.append(message)
    sent = len(b.to_motors)
    for _ in range(3):  # until the board has begun
        if not b.board.machine.is_busy(1000 * b.now):
            b.run(1)
    # What it sends to the motors before that and after it are zeros: C610 without frames stop by themselves.
    quiet = answered(b, 3 * longest)
    assert longest - 5 <= quiet <= longest + 5
    b.run(100)
    assert not any(any(frame.data) for _, frame in b.to_motors[sent:])
    assert b.board.machine.busy_duty == 0
    assert b.board.machine.resets == ["power"] and not b.board.machine.dead
    assert STATES[int(decode(b.last(requests.STATE_ID)).values.state)] == "released"
    answers = [frame for _, frame in b.host if frame.arbitration_id in (requests.REPLY_ID, model_transfer.REPLY_ID)]
    assert answers[-1].data[1] & 15 == 0  # done
    samples = [time for time, frame in b.host if frame.arbitration_id == 0x312]
    assert samples[-1] > b.now - 12
    if longest > SAVING:
        assert b.board.duty == 0.0  # the command of the host is older than its time-out
    b.run(50, {1: 0.3})
    assert b.currents(1)[-1][1] == 300


def test_a_host_that_starts_and_dies_while_a_sector_is_erased_gets_no_current():
    b = warm(blob_of())
    b.waiting += [model_transfer.request("begin", 1000), model_transfer.request("erase", sector=0)]
    b.run(100)
    sent = len(b.to_motors)
    b.run(200, {1: 0.4})  # the controller of the bus keeps three of its frames
    b.run(SECTOR)
    late = [time for time, frame in b.to_motors[sent:] if any(frame.data)]
    assert not late or late[-1] - late[0] <= 2
    assert b.currents(1)[-1][1] == 0


def test_the_brown_out_reset_of_the_chip_is_switched_on_once_where_the_supply_is_good():
    machine = ImageBoard().machine
    assert (machine.flash.options >> 2 & 3, machine.flash.options_written) == (0, 1)  # 2.7 V
    assert machine.flash.options & ~0b1100 == 0x0FFFAAEC & ~0b1100  # nothing else has changed
    machine.reset("power")
    assert machine.flash.options_written == 1
    machine.flash.options, machine.supply_low = 0x0FFFAAEC, True
    machine.reset("supply")
    assert machine.flash.options_written == 1


def test_a_flash_that_is_busy_while_nobody_feeds_the_watchdog_is_a_fault():
    b = warm()
    machine = b.board.machine
    machine._fed = machine.now - 50_000
    machine.flash.busy = 10_000
    with pytest.raises(RuntimeError, match="the watchdog is not fed"):
        machine._wait_for_flash()
