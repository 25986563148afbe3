"""A new model over CAN, on the C code of this machine and on the emulated image: taken, or refused while the old one goes on."""

import struct

import numpy as np
import pytest
from board_bench import Bench

from gravcomp.config import ConfigError
from gravcomp.firmware import model_blob, model_transfer
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.host_board import HostBoard
from gravcomp.firmware.settings import FAULTS

MOTORS = range(1, 7)
KINDS = {"host": HostBoard, "image": ImageBoard}
HEADER, FLOATS = 64, model_blob.SETTINGS


def blob_of(modes: int = 4, motion: float = 1.0) -> bytes:
    """A whole blob of six cables in one piece each, on modes that shorten none of them; `motion`: of the tip by the modes."""
    pairs, cables, points = modes * (modes + 1) // 2, 6, 2
    section = np.zeros((9, modes))
    section[0, 0], section[1, 1], section[2, 2] = motion, motion, 0.1 * motion
    change = np.zeros((cables, 3, modes))
    for k in range(cables):
        change[k, 2, :2] = 0.05 * np.cos(k * np.pi / 3.0), 0.05 * np.sin(k * np.pi / 3.0)
    settings = np.zeros(FLOATS)
    settings[:14] = 0.1, 10.0, 0.01, 5.0, 20.0, -0.03, 0.03, 0.025, 0.05, 3e-4, 0.02, 1e-4, 4e-3, 0.09
    settings[14:22] = 0.0, 0.0, 0.1, 0.0, 0.0, 1.0, 1.0, 1e-3
    settings[23], settings[27:30] = 1.0, 1.0
    settings[36:40], settings[55:57] = (9.81, 1e-3, 1e-3, 0.05), (35.0, 60.0)
    settings[-9:] = 1, 2, 3, 4, 5, 6, 0, 0, 0
    tables = (
        np.zeros((modes, pairs)), np.zeros((pairs, cables)), change, np.eye(3, modes), section,
        (0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0), np.tile((0.0, 0.0, 0.1), (cables, 1)), np.zeros((points, 3, modes)),
        np.linspace((0.0, 0.0, 0.0), (0.0, 0.0, 0.1), points), np.full(cables, 0.1), np.full(cables, 1e-4),
        *[np.zeros(cables)] * 3, np.full(cables, 0.05), settings,
    )  # fmt: skip
    body = b"".join(np.asarray(table, "<f4").tobytes() for table in tables) + bytes(range(cables)) + bytes(2)
    counts = struct.pack("<8I", modes, modes, cables, cables, FLOATS, points, 0, 0)
    head = struct.pack("<4sIII", model_blob.MAGIC, model_blob.VERSION, HEADER + len(body), 0)
    return model_blob.with_crc(head + b"a robot of tests" + counts + body)


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
        (lambda b: changed(b, 4, 2), "another version"),
        (lambda b: b[:-8], "cut off"),
        (lambda b: b[:200] + bytes([b[200] ^ 1]) + b[201:], "CRC"),
        (lambda b: changed(b, 32, 52), "more modes"),
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
    for words in (0, 1, 5, 100, 391):
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
