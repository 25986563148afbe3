"""The documented lines about the board's firmware; without a board and without a CAN device."""

from pathlib import Path

import pytest

from gravcomp.firmware.model_blob import MAGIC

pytestmark = pytest.mark.timeout(900)


@pytest.mark.parametrize(
    ("line", "about"),
    [
        ("./gravcomp firmware install", ""),
        ("./gravcomp firmware build", "KB of flash"),
        ("./gravcomp firmware build --standalone", "KB of flash"),
        ("./gravcomp firmware flash --show", "was not written"),
        ("./gravcomp firmware model ROBOT.yaml", "multiply-adds"),
    ],
)
def test_an_image_and_a_model_are_built(type_in, line, about):
    code, output = type_in(line, ROBOT="ROBOT.yaml")
    assert code == 0 and about in output, output


def test_the_firmware_is_tested(type_in):
    """With the tests of a short file: all of them are tests of this run as well, and here they would run a second time."""
    code, output = type_in("./gravcomp firmware test", "--frames 2000 -k test_board_heater.py")
    assert code == 0 and "lines reached" in output, output


@pytest.mark.skipif(Path("/sys/class/net/can0").exists(), reason="there is a can0: a board may hang on it")
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("./gravcomp doctor --board --interface socketcan --channel can0", 1),
        ("./gravcomp doctor --board --motor 1 --current 0.2 --out reports --interface socketcan --channel can0", 1),
        ("./gravcomp firmware parameters ROBOT.yaml --interface socketcan --channel can0", 2),
        ("./gravcomp firmware send build/firmware/NAME.model --interface socketcan --channel can0", 2),
    ],
)
def test_a_board_without_its_can_device_is_reported(type_in, folder, line, expected):
    (folder / "build" / "firmware").mkdir(parents=True, exist_ok=True)
    (folder / "build" / "firmware" / "NAME.model").write_bytes(MAGIC)  # what it begins with: the board checks the rest
    code, output = type_in(line, ROBOT="ROBOT.yaml")
    assert code == expected and "can0" in output and "Traceback" not in output, output
