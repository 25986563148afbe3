"""Intervals and thresholds of the calibration, on a robot whose tips follow from a few numbers."""

import dataclasses

import numpy as np
import pytest

from gravcomp.calibration.estimates import unfit
from gravcomp.calibration.fit import TipNoise, fit_statics
from gravcomp.calibration.measured import Measured, MeasurementError, StillWindows, still_windows
from gravcomp.calibration.parameters import StaticParameters
from gravcomp.calibration.report import origin_of
from gravcomp.calibration.standstill import Standstill, noise_of
from gravcomp.calibration.statics import StaticPrediction
from gravcomp.calibration.unknowns import Priors, Unknown
from gravcomp.description import load_robot_file

SEEDS = 40
GROUPS = {"offsets", "compliance", "winding"}
TRUE_RATIO, TRUE_OFFSET = np.array([1.06, 0.95]), 4e-4  # of the described moduli; m


@pytest.fixture(scope="module")
def robot():
    return load_robot_file("article").robot


class Springs:
    """Tips that depend on log moduli, offsets and the tensions' stretch by fixed random numbers, a little nonlinearly."""

    def __init__(self, robot, windows: StillWindows):
        self.windows, self._robot = windows, robot
        random = np.random.default_rng(7)
        count, scale = len(windows.gravity), np.repeat([robot.length, 1.0], 3)[:, None]
        self._by_modulus = 0.2 * scale * random.standard_normal((count, 6, 2))
        self._tension = np.where(np.isnan(windows.displacement), 0.0, 1.0)
        by_offset = 3.0 * scale / robot.length * random.standard_normal((count, 6, len(robot.cables)))
        self._by_offset = by_offset * self._tension[:, None, :]

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        bent, pulled = self._bent(parameters), self._pulled(parameters)
        return StaticPrediction(
            self._by_modulus @ np.sinh(bent) + np.einsum("kec,kc->ke", self._by_offset, pulled), self._tension
        )

    def differentiate(self, parameters: StaticParameters, kinds: set[str]) -> dict[str, np.ndarray]:
        return {
            "modulus": self._by_modulus * np.cosh(self._bent(parameters)),
            "offset": self._by_offset,
            "compliance": -self._by_offset * self._tension[:, None, :],
            "winding": np.einsum("kec,kc->ke", self._by_offset, np.nan_to_num(self.windows.displacement))[:, :, None],
        }

    def _bent(self, parameters: StaticParameters) -> np.ndarray:
        described = np.array([material.youngs_modulus for material in self._robot.materials])
        return np.log(parameters.youngs_modulus / described)

    def _pulled(self, parameters: StaticParameters) -> np.ndarray:
        wound = np.nan_to_num(self.windows.displacement)
        return parameters.winding * wound + parameters.offset - parameters.compliance * self._tension


def measured_springs(robot, seed: int, noise: float, winding: float = 1.0) -> Springs:
    """Springs whose windows have the tips of the true parameters, with noise: in shares of the length, and in rad."""
    count, cables = 30, len(robot.cables)
    wound = np.full((count, cables), np.nan)
    wound[np.arange(count), np.arange(count) % cables] = 1e-3 * (1 + np.arange(count) // cables % 3)
    empty = StillWindows(np.tile([-9.81, 0.0, 0.0], (count, 1)), wound, np.zeros((count, 3)), np.zeros((count, 3)))
    springs = Springs(robot, empty)
    described = np.array([material.youngs_modulus for material in robot.materials])
    compliance = np.array([robot.cable_compliance(cable) for cable in robot.cables])
    true = StaticParameters(TRUE_RATIO * described, np.full(cables, TRUE_OFFSET), compliance, winding)
    tip = springs.predict(true).tip
    tip += noise * np.repeat([robot.length, 1.0], 3) * np.random.default_rng(seed).standard_normal(tip.shape)
    springs.windows = dataclasses.replace(empty, tip_position=tip[:, :3], tip_direction=tip[:, 3:])
    return springs


def test_intervals_of_95_per_cent_cover_the_truth(robot):
    """Over the seeds, for moduli and for offsets; and they are not much wider than the scatter of the values."""
    inside: dict[str, list[bool]] = {"modulus": [], "offset": []}
    values, widths = [], []
    for seed in range(SEEDS):
        springs = measured_springs(robot, seed, 3e-3)
        fit = fit_statics(robot, springs.windows, groups=GROUPS, noise=TipNoise(stiffness=0.0), predictor=springs)
        for estimate in fit.estimates:
            if "modulus" in estimate.name:
                segment = int("distal" in estimate.name)
                true = robot.materials[segment].youngs_modulus * 1e-6 * TRUE_RATIO[segment]
                inside["modulus"].append(abs(estimate.value - true) <= estimate.interval)
            elif "offset" in estimate.name and estimate.seen:
                inside["offset"].append(abs(estimate.value - 1e3 * TRUE_OFFSET) <= estimate.interval)
        values.append(fit.estimates[0].value)
        widths.append(fit.estimates[0].interval)
    assert {name: np.mean(hits) >= 0.9 for name, hits in inside.items()} == {"modulus": True, "offset": True}
    assert np.mean(widths) < 4.0 * np.std(values)


def test_what_the_data_do_not_show_keeps_its_value_with_a_reason(robot):
    springs = measured_springs(robot, 0, 3e-3)
    fit = fit_statics(robot, springs.windows, groups=GROUPS, predictor=springs, priors=Priors(stretch=1e-5))
    unseen = [estimate for estimate in fit.estimates if not estimate.seen]
    assert any("compliance" in estimate.name for estimate in unseen)
    assert all(estimate.value == pytest.approx(estimate.initial, rel=1e-9) for estimate in unseen)
    assert any("cannot be told from these data" in warning and "compliance" in warning for warning in fit.warnings)


class Rubbing(Springs):
    """Tips that friction inside the material holds back, and that creep, by fixed random numbers too."""

    def __init__(self, springs: Springs, robot):
        super().__init__(robot, springs.windows)
        random, scale = np.random.default_rng(8), np.repeat([robot.length, 1.0], 3)[:, None]
        self._by_time = 0.5 * scale * random.standard_normal((len(self.windows.gravity), 6, 3))

    def predict(self, parameters: StaticParameters) -> StaticPrediction:
        own = super().predict(parameters)
        return StaticPrediction(own.tip + self._by_time @ [*parameters.creep, parameters.slip], own.tension)

    def differentiate(self, parameters: StaticParameters, kinds: set[str]) -> dict[str, np.ndarray]:
        return super().differentiate(parameters, kinds) | {"creep": self._by_time[:, :, :2], "slip": self._by_time[:, :, 2:]}


def test_friction_inside_the_material_is_fitted_but_not_told(robot):
    """On whole virtual robots a third of the truth is found and less, with a scatter that says nothing of it."""
    rubbing = Rubbing(measured_springs(robot, 0, 0.0), robot)
    described = np.array([material.youngs_modulus for material in robot.materials])
    compliance = np.array([robot.cable_compliance(cable) for cable in robot.cables])
    found, usual = 0.007, 0.04
    true = StaticParameters(
        TRUE_RATIO * described, np.zeros(len(compliance)), compliance, creep=np.array([0.03, 0.04]), slip=found
    )
    tip = rubbing.predict(true).tip
    rubbing.windows = dataclasses.replace(rubbing.windows, tip_position=tip[:, :3], tip_direction=tip[:, 3:])
    fit = fit_statics(robot, rubbing.windows, groups={"creep"}, creep_times=(2.0, 20.0), predictor=rubbing)
    (slip,) = (estimate for estimate in fit.estimates if estimate.kind == "slip")
    assert slip.value == pytest.approx(found, abs=0.1 * usual) and not slip.reason
    assert fit.parameters.youngs_modulus == pytest.approx(TRUE_RATIO * described, rel=2e-3)  # it does not stand for friction
    assert not slip.seen and slip.value + slip.interval > usual
    assert any("friction inside the material: fitted" in warning and "not told" in warning for warning in fit.warnings)
    assert all(estimate.seen for estimate in fit.estimates if estimate.kind == "creep")
    assert "hardly seen" in origin_of("robot", "data", fit)["values_at_95_percent"][slip.name]


class OneModulus(Springs):
    """Of the first `count` windows, whose tips move with the moduli of some segments only."""

    def __init__(self, springs: Springs, robot, count: int, told: tuple[float, float]):
        rows = springs.windows
        parts = (rows.gravity, rows.displacement, rows.tip_position, rows.tip_direction)
        super().__init__(robot, StillWindows(*(part[:count] for part in parts)))
        self._by_modulus *= np.array(told)


@pytest.mark.parametrize(("count", "told", "noise", "value"), [(1, (1.0, 0.0), 0.0, 1.06), (3, (0.07, 0.0), 2e-2, 1.0)])
def test_a_modulus_that_no_tip_shows_follows_the_others_or_stays_as_described(robot, count, told, noise, value):
    """Of one window its interval is that of the prior, and not four times as wide, as if all unknowns used up data."""
    whole = measured_springs(robot, 0, 3e-3)
    few = OneModulus(whole, robot, count, told)
    described = np.array([material.youngs_modulus for material in robot.materials])
    compliance = np.array([robot.cable_compliance(cable) for cable in robot.cables])
    tip = few.predict(StaticParameters(1.06 * described, np.full(len(compliance), TRUE_OFFSET), compliance)).tip
    tip += noise * np.repeat([robot.length, 1.0], 3) * np.random.default_rng(1).standard_normal(tip.shape)
    few.windows = dataclasses.replace(few.windows, tip_position=tip[:, :3], tip_direction=tip[:, 3:])
    fit = fit_statics(robot, few.windows, groups=GROUPS, predictor=few)
    unseen = fit.estimates[1]
    assert not unseen.seen and bool(unseen.reason) == bool(noise)
    assert noise or unseen.interval < 0.8 * unseen.value
    assert unseen.value == pytest.approx(value * unseen.initial, rel=0.02)
    assert f"{unseen.value:.4g}" in origin_of("robot", "data", fit)["values_at_95_percent"][unseen.name]


def test_a_stretch_that_might_be_none_or_twice_as_much_is_not_told():
    compliance = Unknown("compliance", (0,), 1e-5)
    assert "± 100% of it" in unfit(compliance, 0.1, 0.3, 0.6, [], initial=0.5)
    assert "more than all of it" in unfit(compliance, -0.5, 0.3, 0.6, [], initial=0.5)
    assert not unfit(compliance, 0.1, 0.1, 0.2, [], initial=0.5)
    assert not unfit(compliance, 0.9, 0.4, 0.8, [], initial=0.5)  # the described value is outside the interval


def test_values_that_fit_worse_than_the_described_ones_are_refused(robot):
    """Directions that want another modulus than the positions, which fit the described robot exactly."""
    springs = measured_springs(robot, 0, 0.0)
    described = np.array([material.youngs_modulus for material in robot.materials])
    compliance = np.array([robot.cable_compliance(cable) for cable in robot.cables])
    exact, other = (
        springs.predict(StaticParameters(ratio * described, np.zeros(len(compliance)), compliance)).tip for ratio in (1.0, 1.1)
    )
    springs.windows = dataclasses.replace(springs.windows, tip_position=exact[:, :3], tip_direction=other[:, 3:])
    with pytest.raises(MeasurementError, match=r"describe these data better than the robot file.*nothing is written"):
        fit_statics(robot, springs.windows, groups=set(), predictor=springs)


def test_a_winding_ratio_that_no_maker_delivers_is_refused(robot):
    springs = measured_springs(robot, 0, 1e-4, winding=1.16)
    fit = fit_statics(robot, springs.windows, groups={"winding"}, predictor=springs)
    winding = fit.estimates[-1]
    assert winding.name == "winding ratio" and winding.value == 1.0 and "no capstan" in winding.reason


@pytest.mark.parametrize("size", [0.5, 1.0, 4.0])
def test_a_robot_of_any_size_is_at_rest_by_the_same_share_of_its_swing(robot, size):
    """Lengths times `size`, times its root: the windows are the same ones."""
    segments = tuple(dataclasses.replace(s, length=size * s.length) for s in robot.segments)
    period = 0.28 * size**0.5
    still = Standstill.of(dataclasses.replace(robot, segments=segments, cables=()), period)
    beats = 0.05 * np.arange(500)  # time in periods
    swing = 0.2 * robot.length * np.exp(-0.4 * beats) * np.cos(2 * np.pi * beats)
    tip = size * np.column_stack([swing, 0.0 * swing, np.full(500, robot.length)])
    measured = Measured(
        "here", np.zeros(500, int), period * beats, np.tile([-9.81, 0, 0], (500, 1)), np.full((500, 6), np.nan), tip
    )
    windows = still_windows(measured, still)
    assert len(windows.tip_position) == 1
    np.testing.assert_allclose(windows.tip_position / size, [[0.0, 0.0, robot.length]], atol=1e-5)
    with pytest.raises(MeasurementError, match="never at rest"):
        still_windows(measured.rows(slice(0, 120)), still)


def test_the_noise_of_a_tracker_is_seen_in_a_moving_tip():
    time = 0.02 * np.arange(400)
    tip = np.column_stack([np.sin(3 * time), np.cos(2 * time), time]) * 0.02
    noise = 2e-4 * np.random.default_rng(1).standard_normal(tip.shape)
    assert noise_of(tip + noise) == pytest.approx(2e-4, rel=0.15)
