"""The board's own control of the IMU's temperature: for a robot without a host, and only where it is switched on."""

import pytest
from board_bench import Bench

from gravcomp.canbus.codec import encode
from gravcomp.firmware.emulator.image_board import ImageBoard
from gravcomp.firmware.host_board import HostBoard
from gravcomp.firmware.settings import settings_alone
from gravcomp.thermal import HeaterOptions, ThermalPlant, ThermalPlantOptions

STILL = (10, 20, 5460, 1, 2, 3)
OWN = settings_alone(HeaterOptions())


def test_a_board_without_a_host_brings_the_imu_to_its_target_and_keeps_it_there():
    board, plant = HostBoard(OWN), ThermalPlant(ThermalPlantOptions(ambient=18.0, rise=45.0))
    late = []
    for step in range(1, 40_000):  # 400 s
        plant.step(0.01, board.duty)
        board.sample(STILL, round(8.0 * (plant.reading - 23.0)), 10_000 * step)
        board.advance(10_000 * step)
        if step % 100 == 0:
            board.sent()
        if step > 30_000:
            late.append(plant.temperature)
    assert max(late) - min(late) < 0.5 and sum(late) / len(late) == pytest.approx(18.0 + 15.0, abs=0.3)
    assert settings_alone(HeaterOptions(target=41.0))["heater_target"] == 41


@pytest.mark.parametrize("kind", [HostBoard, ImageBoard])
def test_the_host_comes_first_and_the_limits_of_the_heater_hold(kind):
    b = Bench(kind(OWN))
    b.temperature = 8 * (35 - 23)  # a warm chip: the ambient counts as 30 degC
    b.run(300, feedback=False)
    assert b.board.duty == 1.0  # 10 degC below its target
    b.board.receive(encode("HeaterCommand", duty=0.2, sequence=0))
    b.run(20, feedback=False)
    assert b.board.duty == pytest.approx(0.2)
    b.run(510, feedback=False)
    assert b.board.duty == 1.0
    b.temperature = 8 * (65 - 23) + 1
    b.run(20, feedback=False)
    assert b.board.duty == 0.0
    b.temperature = 8 * (44 - 23)
    b.run(20, feedback=False)
    assert 0.2 < b.board.duty < 0.4  # 1 degC below the target: 0.25, and what one period adds to the integral
    b.silent = True
    b.run(1600, feedback=False)
    assert b.board.duty == 0.0


def test_nothing_heats_without_a_command_where_it_is_not_switched_on():
    b = Bench(HostBoard())
    b.run(3000, feedback=False)
    assert b.board.duty == 0.0
