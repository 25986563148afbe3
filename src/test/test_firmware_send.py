"""`firmware send` to a board that is another process: a model over a bus of this host, taken or refused."""

import argparse
import subprocess
import sys
from pathlib import Path

import can
import pytest
from board_bench import blob_of

from gravcomp.canbus.codec import check_byte
from gravcomp.canbus.multicast import private_channel
from gravcomp.commands import firmware
from gravcomp.config import ConfigError
from gravcomp.description.hardware import CanInterface
from gravcomp.firmware import client as client_module
from gravcomp.firmware.client import BoardClient

pytestmark = pytest.mark.slow

JOYSTICK, LOOP_STATUS = 0x328, 0x318


@pytest.fixture
def channel():
    """The channel of a bus on which a board of another process is."""
    channel, script = private_channel(), Path(__file__).parent / "board_process.py"
    process = subprocess.Popen([sys.executable, str(script), channel], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    yield channel
    process.stdin.close()
    process.stdout.close()
    assert process.wait(30.0) == 0


def send(path: Path, blob: bytes, channel: str) -> int:
    path.write_bytes(blob)
    parser = argparse.ArgumentParser()
    firmware.add_arguments(parser)
    return firmware.run(parser.parse_args(["send", str(path), "--interface", "udp_multicast", "--channel", channel]))


def modes(channel: str) -> int:
    """Return the number of modes of the model that the board uses, from its loop's status."""
    data = bytes(7)
    data += bytes([check_byte(JOYSTICK, data)])
    with BoardClient(CanInterface("udp_multicast", channel)) as client:
        client.send(can.Message(arbitration_id=JOYSTICK, is_extended_id=False, data=data))
        return next(frame.data[2] for frame in client.listen(20.0) if frame.arbitration_id == LOOP_STATUS)


def test_a_model_is_sent_to_the_board_of_another_process(channel, tmp_path):
    path = tmp_path / "robot.model"
    assert modes(channel) == 4
    assert send(path, blob_of(8), channel) == 0
    assert modes(channel) == 8
    with pytest.raises(ConfigError, match="cut off; the old one goes on"):
        send(path, blob_of(12)[:-40], channel)
    assert modes(channel) == 8


def test_a_board_that_is_on_another_bus_does_not_answer(tmp_path, monkeypatch):
    monkeypatch.setattr(client_module, "_ERASING", 0.1)
    with pytest.raises(ConfigError, match="the board does not answer"):
        send(tmp_path / "robot.model", blob_of(), private_channel())
