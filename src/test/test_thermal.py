"""Temperature control: it settles without overshoot on all likely boards, and switches the heater off at every fault."""

import math

import pytest

from gravcomp.thermal import HeaterControl, HeaterFault, HeaterOptions, ThermalPlant, ThermalPlantOptions
from gravcomp.thermal.pid import Pid, PidOptions

SECOND = 1_000_000_000


def heated(plant, control, duration, *, period=0.1, begin=0.0, reading=None):
    """Run the loop; return true temperatures and states. `reading(t, plant)` replaces the chip's reading."""
    temperatures, states = [], []
    duty = control.state.duty
    for k in range(round(duration / period)):
        time = begin + k * period
        plant.step(period, duty)
        state = control.update(round(time * SECOND), plant.reading if reading is None else reading(time, plant))
        duty = state.duty
        temperatures.append(plant.temperature)
        states.append(state)
    return temperatures, states


@pytest.mark.parametrize(
    "board",
    [{}, {"ambient": -5.0}, {"rise": 30.0}, {"rise": 80.0}, {"time_constant": 30.0}, {"time_constant": 120.0}],
)
def test_settles_within_two_minutes_with_little_overshoot(board):
    control = HeaterControl()
    temperatures, states = heated(ThermalPlant(ThermalPlantOptions(**board)), control, 300.0)
    target = board.get("ambient", 20.0) + 15.0
    assert states[-1].target == target
    assert all(abs(t - target) <= 0.5 for t in temperatures[1200:])
    assert max(temperatures) <= target + 2.0
    assert states[-1].ready and not states[100].ready


def test_the_target_is_fixed_or_limited():
    assert HeaterControl(HeaterOptions(target=45.0)).update(0, 20.0).target == 45.0
    assert HeaterControl(HeaterOptions(rise=60.0)).update(0, 20.0).target == 60.0


def test_a_chip_that_is_still_warm_does_not_raise_the_target():
    """Neither after a reset, nor in a new control of the same process, nor after repeated restarts."""
    control = HeaterControl()
    assert control.update(0, 20.0).target == 35.0
    control.reset()
    assert control.update(2 * SECOND, 35.0).target == 35.0
    assert HeaterControl(ambient=control.ambient).update(0, 35.0).target == 35.0
    assert HeaterControl().update(0, 35.0).target == HeaterControl().update(0, 45.0).target == 45.0


def test_the_chip_renews_its_reading_only_every_1_28_s_in_steps_of_an_eighth():
    plant, readings = ThermalPlant(), []
    for _ in range(300):
        plant.step(0.01, 1.0)
        readings.append(plant.reading)
    changes = [k for k in range(1, 300) if readings[k] != readings[k - 1]]
    assert changes == [127, 255]
    assert all((r / 0.125).is_integer() for r in readings)


def test_the_integral_does_not_wind_up_at_the_limit():
    pid = Pid(PidOptions(gain=0.1, integral_time=10.0))
    for _ in range(1000):
        assert pid.update(1.0, 100.0, 20.0) == 1.0
    # Below the limit immediately when the sign of the error changes.
    assert pid.update(1.0, 100.0, 101.0) == 0.0


def test_a_new_target_gives_no_derivative_kick():
    with_derivative, without = Pid(PidOptions(derivative_time=20.0)), Pid(PidOptions())
    for pid in (with_derivative, without):
        pid.update(1.0, 30.0, 30.0)
    assert with_derivative.update(1.0, 31.0, 30.0) == without.update(1.0, 31.0, 30.0)


def test_over_temperature_switches_off_until_reset():
    control = HeaterControl()
    control.update(0, 20.0)
    assert control.update(2 * SECOND, 71.0).fault is HeaterFault.OVER_TEMPERATURE
    state = control.update(4 * SECOND, 25.0)
    assert state.fault is HeaterFault.OVER_TEMPERATURE and state.duty == 0.0
    control.reset()
    assert control.update(6 * SECOND, 25.0).fault is HeaterFault.NONE


def test_a_heater_that_stays_on_is_detected_far_above_the_target():
    plant, control = ThermalPlant(ThermalPlantOptions(rise=60.0)), HeaterControl()
    for k in range(3000):
        plant.step(0.1, 1.0)
        state = control.update(k * SECOND // 10, plant.reading)
    assert state.fault is HeaterFault.OVER_TEMPERATURE and state.duty == 0.0


@pytest.mark.parametrize("cause", ["dead heater", "stuck reading"])
def test_a_chip_that_does_not_warm_switches_the_heater_off(cause):
    plant, control = ThermalPlant(), HeaterControl()
    heater = 0.0 if cause == "dead heater" else 1.0
    for k in range(600):
        plant.step(0.1, heater * control.state.duty)
        state = control.update(k * SECOND // 10, plant.reading if cause == "dead heater" else 20.0)
    assert state.fault is HeaterFault.DEAD_HEATER and state.duty == 0.0 and not state.ready


def test_a_dead_sensor_switches_the_heater_off_until_it_answers_again():
    control = HeaterControl()
    assert control.update(0, 20.0).duty > 0.0
    assert control.check(4 * SECOND).fault is HeaterFault.NONE
    state = control.check(6 * SECOND)
    assert state.fault is HeaterFault.DEAD_SENSOR and state.duty == 0.0
    state = control.update(7 * SECOND, 20.0)
    assert state.fault is HeaterFault.NONE and state.duty > 0.0


@pytest.mark.parametrize("reading", [math.nan, math.inf, -100.0, 500.0])
def test_an_invalid_reading_switches_the_heater_off_while_it_lasts(reading):
    control = HeaterControl()
    control.update(0, 20.0)
    state = control.update(2 * SECOND, reading)
    assert state.fault is HeaterFault.BAD_READING and state.duty == 0.0
    assert control.update(4 * SECOND, 20.0).duty > 0.0


def test_repeated_readings_do_not_drive_the_loop_faster():
    slow, fast = HeaterControl(), HeaterControl()
    slow_temperatures, _ = heated(ThermalPlant(), slow, 40.0, period=0.64)
    fast_temperatures, _ = heated(ThermalPlant(), fast, 40.0, period=0.01)
    # Tolerance of two counts of the chip: the two loops see a renewal up to half a second apart.
    assert slow_temperatures[-1] == pytest.approx(fast_temperatures[-1], abs=0.25)
