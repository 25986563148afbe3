"""The codec agrees with the DBC and refuses invalid frames; the frames are those of the manuals."""

import random
import re
from importlib import resources

import can
import cantools
import pytest

from gravcomp.canbus import c610, codec
from gravcomp.canbus.imu_scales import accelerometer_scale, gyroscope_scale
from gravcomp.description.hardware import MOTOR_IDS

DBC = resources.files("gravcomp.canbus").joinpath("gravcomp.dbc").read_text(encoding="utf-8")
DATABASE = cantools.database.load_string(DBC, "dbc")


@pytest.mark.parametrize("message", DATABASE.messages, ids=lambda m: m.name)
def test_codec_equals_cantools_on_random_bytes(message):
    random.seed(message.frame_id)
    for _ in range(200):
        data = bytearray(random.randbytes(message.length))
        if "check" in [s.name for s in message.signals]:
            data[-1] = codec.check_byte(message.frame_id, bytes(data[:-1]))
        ours = codec.decode(can.Message(arbitration_id=message.frame_id, is_extended_id=False, data=data))
        theirs = message.decode(bytes(data), decode_choices=False)
        assert ours.name == message.name
        assert ours.values._asdict() == pytest.approx(theirs, rel=1e-12, abs=1e-12)


def test_motor_frames_are_those_of_the_c610_manual():
    command = codec.encode("MotorCommand1to4", current_1=10.0, current_2=-10.0, current_3=0.001, current_4=0.0)
    assert (command.arbitration_id, bytes(command.data)) == (0x200, bytes.fromhex("2710 d8f0 0001 0000"))
    feedback = can.Message(arbitration_id=0x203, is_extended_id=False, data=bytes.fromhex("1fff fe0c 01f4 0000"))
    assert codec.decode(feedback).values == (8191, -500, pytest.approx(0.5))


def test_scales_are_those_of_the_bmi088_data_sheet():
    assert accelerometer_scale(0) * 10920 == pytest.approx(9.80665)
    assert accelerometer_scale(3) * 1365 == pytest.approx(9.80665)
    assert gyroscope_scale(0) * 32767 == pytest.approx(34.906585)  # 2000 deg/s


def test_check_byte_is_crc8_sae_j1850():
    assert codec.check_byte(ord("1"), b"23456789") == 0x4B


def test_a_single_flipped_bit_in_a_board_frame_is_detected():
    frame = codec.encode("ImuGyroscope", x=100, y=-200, z=300, sequence=17)
    for bit in range(64):
        data = bytearray(frame.data)
        data[bit // 8] ^= 1 << bit % 8
        with pytest.raises(codec.FrameError, match="check"):
            codec.decode(can.Message(arbitration_id=frame.arbitration_id, is_extended_id=False, data=data))


@pytest.mark.parametrize(
    ("frame", "complaint"),
    [
        (can.Message(arbitration_id=0x7AA, is_extended_id=False, data=bytes(8)), "0x7AA is not in gravcomp.dbc"),
        (can.Message(arbitration_id=0x201, is_extended_id=False, data=bytes(3)), "has 3 bytes; 8 are needed"),
        (can.Message(arbitration_id=0x201, is_extended_id=True, data=bytes(8)), "not a standard data frame"),
        (can.Message(arbitration_id=0x201, is_extended_id=False, is_remote_frame=True, dlc=8), "not a standard data frame"),
    ],
)
def test_invalid_frames_are_refused(frame, complaint):
    with pytest.raises(codec.FrameError, match=re.escape(complaint)):
        codec.decode(frame)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 33.0, -33.0])
def test_values_that_do_not_fit_are_refused(value):
    with pytest.raises(codec.FrameError, match=r"MotorCommand5to8\.current_5"):
        codec.encode("MotorCommand5to8", current_5=value, current_6=0, current_7=0, current_8=0)


@pytest.mark.parametrize("given", [{"duty": 0.5}, {"duty": 0.5, "sequence": 1, "current": 0.0}, {"duty": 0.5, "current": 0.0}])
def test_other_signals_than_those_of_the_frame_are_refused(given):
    with pytest.raises(codec.FrameError, match=f"HeaterCommand has the signals .*; got {', '.join(given)}$"):
        codec.encode("HeaterCommand", **given)


def test_every_frame_of_the_dbc_is_documented():
    page = resources.files("gravcomp.canbus").joinpath("FRAMES.md").read_text(encoding="utf-8")
    for message in DATABASE.messages:
        if message.name.startswith("Motor"):
            continue  # the page lists the C610's frames as ranges of ids
        assert f"0x{message.frame_id:X}" in page and f"`{message.name}`" in page


def test_the_ids_of_the_motor_frames_are_those_of_the_dbc():
    assert [codec.layout(name).frame_id for name in c610.COMMANDS] == list(c610.COMMAND_IDS)
    assert [codec.layout(name).frame_id for name in c610.FEEDBACKS] == [c610.feedback_id(can_id) for can_id in MOTOR_IDS]
    for name, ids in c610.COMMANDS.items():
        sent = dict.fromkeys(ids, c610.LARGEST_CURRENT)
        assert c610.currents_of(*codec.decode(c610.command(name, sent))) == sent
    step = codec.decode(c610.command("MotorCommand1to4", {1: 1 / c610.COUNTS_PER_AMPERE})).values
    assert step.current_1 == codec.layout("MotorCommand1to4").signals[0].scale
