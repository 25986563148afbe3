"""A new model over CAN, on the C code of this machine and on the emulated image: taken, or refused while the old one goes on."""

import struct

import pytest
from board_bench import Bench, blob_of

from gravcomp.config import ConfigError
from gravcomp.firmware import model_blob, model_transfer
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.host_board import HostBoard
from gravcomp.firmware.settings import FAULTS

MOTORS = range(1, 7)
KINDS = {"host": HostBoard, "image": ImageBoard}


def changed(blob: bytes, at: int, value: int) -> bytes:
    return model_blob.with_crc(blob[:at] + struct.pack("<I", value) + blob[at + 4 :])


@pytest.fixture(params=KINDS)
def board(request):
    """A board with a model, behind which six motors answer."""
    return Bench(KINDS[request.param]({}, model=blob_of()), MOTORS)


def has_model(bench) -> bool:
    return not bench.board.faults >> FAULTS.index("no whole model on the board") & 1


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda b: changed(b, 16, 0), "another robot"),
        (lambda b: changed(b, 4, 1), "another version"),
        (lambda b: b[:-8], "cut off"),
        (lambda b: b + bytes(8), "size"),
        (lambda b: b[:200] + bytes([b[200] ^ 1]) + b[201:], "CRC"),
        (lambda b: changed(b, 32, 52), "more modes"),
        (lambda b: changed(b, 44, model_blob.PIECES_MAX + 1), "pieces of cables"),
        (lambda b: b + bytes(model_transfer.SLOT), "384 KB"),
        (lambda b: b"XXXX" + b[4:], "no blob"),
    ],
)
def test_a_spoilt_model_is_refused_and_the_old_one_goes_on(board, spoil, reason):
    board.run(20)
    with pytest.raises(ConfigError, match=reason):
        board.transfer(model_transfer.sending(spoil(blob_of(motion=2.0))))
    assert has_model(board)
    board.restart()
    assert has_model(board)


def test_a_model_comes_over_the_bus_though_frames_are_lost(board):
    board.run(20)
    lost = iter([False] * 40 + [True] * 3 + [False] * 30 + [True] * 40)
    blob = blob_of(8)
    board.transfer(model_transfer.sending(blob), lose=lambda message: message.arbitration_id == 0x32A and next(lost, False))
    assert board.answers[-1].taken == len(blob) and any(answer.reason == "frames were lost" for answer in board.answers)
    board.restart()
    assert has_model(board)
    board.transfer(model_transfer.forgetting())
    assert not has_model(board)
    other = changed(blob, 16, 0)  # now that of another robot is welcome
    board.run(20)
    board.transfer(model_transfer.sending(other))
    assert has_model(board)


def test_a_supply_lost_at_any_word_leaves_a_whole_model(board):
    """The last two: before the first word, which makes the new model a whole one, and before the old one's is taken away."""
    every = len(blob_of(8)) // 4
    for words in (0, 1, 100, every - 1, every):
        board.run(20)
        board.board.lose_supply_after(words)
        with pytest.raises(ConfigError):
            board.transfer(model_transfer.sending(blob_of(8)))
        board.board.lose_supply_after(-1)
        board.restart(1)
        assert has_model(board), words


def test_a_board_that_drives_motors_takes_no_model(board):
    board.board.set({"wiring": 1, "motors": 0b111111})
    board.run(20)
    board.run(20, {1: 0.1})
    board.waiting += [model_transfer.request("begin", 1000)]
    begin = len(board.host)
    board.run(4, {1: 0.1})
    answers = [a for _, frame in board.host[begin:] if (a := model_transfer.answer_of(frame))]
    assert [answer.reason for answer in answers] == ["it drives motors: stop it first"]
    with pytest.raises(ConfigError, match="does not answer"):
        Bench(type(board.board)()).transfer(model_transfer.sending(blob_of()))  # firmware without the loop
