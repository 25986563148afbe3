"""The observer of the tip on a linear model in one plane of the tests' own, and in the loop."""

import dataclasses

import numpy as np
import pytest

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import load_robot_file
from gravcomp.full_model.shape import Response
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.inverse import straight_target
from gravcomp.tip_observer import TipObserver, TipObserverOptions, TrackerState
from gravcomp.tip_observer.load_change import LoadChange
from gravcomp.trials.tracked import with_wrong_model
from gravcomp.virtual.motion import StaticMotion, base_orientation
from gravcomp.virtual.tracker import VirtualTracker

ROBOT = load_robot_file("article").robot
REST = np.array([0.0, 0.0, ROBOT.length])
STRAIGHT = straight_target(ROBOT.length)
SAG = 0.03  # m, released and horizontal
STEP = 0.01  # s
START = 1.7e9  # s, a stamp of these years
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class Model:
    """A model whose tip hangs by SAG towards `down`, and one cable that holds it up with `held` of that."""

    def __init__(self, observer: TipObserver):
        self.observer, self.time, self.tip = observer, START, REST
        self.down, self.held, self.touching = np.array([-1.0, 0.0, 0.0]), 0.0, False
        self.moved = np.zeros(3)  # by the correction

    def run(self, duration: float, held: float | None = None) -> None:
        before, after = self.held, self.held if held is None else held
        steps = round(duration / STEP)
        for step in range(1, steps + 1):
            self.held = before + (after - before) * step / steps
            self.time += STEP
            sag = SAG * self.down
            self.tip = REST + (1.0 - self.held) * sag + self.moved
            response = Response(
                compliance_aa=np.array([[1e-3]]),
                compliance_ea=np.append(-sag, np.zeros(3))[:, None],
                displacement_free=np.array([-5e-4]),
                effector_free=np.append(REST + sag, [0.0, 0.0, 1.0]),
            )
            self.observer.predict(self.time, self.tip, UPRIGHT, response, np.array([self.held]), self.touching)
            corrected = self.observer.corrected(STRAIGHT, self.time)
            if not self.touching and self.held > 0.0:
                self.moved = corrected.tip_position - REST

    def measure(self, position: np.ndarray, late: float = 0.0, frame: str = "soft_base") -> bool:
        return self.observer.measure(self.time - late, self.time, frame, position)

    @property
    def status(self):
        return self.observer.status(self.time)


def model(**options) -> Model:
    made = Model(TipObserver(ROBOT, TipObserverOptions(**options)))
    made.run(0.5)
    return made


def follow(made: Model, error: np.ndarray, seconds: float, seed: int = 0, std: float = 0.5e-3) -> int:
    """Measure at 5 Hz a tip with this error to the model; return how many measurements were accepted."""
    random, used = np.random.default_rng(seed), 0
    for _ in range(round(5 * seconds)):
        made.run(0.2)
        used += made.measure(made.tip + error + std * random.standard_normal(3))
    return used


def test_target_is_unchanged_without_measurements() -> None:
    made, target = model(), straight_target(ROBOT.length)
    assert made.observer.corrected(target, made.time) is target
    assert made.status.state == TrackerState.NONE and not made.status.sentence


def test_constant_error_is_found_within_seconds() -> None:
    made, error = model(), np.array([1.5e-3, -0.8e-3, 0.3e-3])
    made.run(0.5, held=1.0)
    follow(made, error, 6.0)
    assert np.linalg.norm(made.status.offset - error) < 0.3e-3
    corrected = made.observer.corrected(straight_target(ROBOT.length), made.time)
    np.testing.assert_allclose(corrected.tip_position, REST - made.status.offset)
    assert made.status.state == TrackerState.USED


def test_cables_that_move_to_and_fro_with_the_corrections_leave_the_estimate_as_certain_as_it_is() -> None:
    """Else a correction by a noisy measurement would make the next one larger: the tip was never at rest."""

    def scatter(to_and_fro: float) -> float:
        made, offsets = model(), []
        made.run(0.5, held=1.0)
        random = np.random.default_rng(3)
        for _ in range(150):
            noise, motion = 0.5e-3 * random.standard_normal(3), to_and_fro * random.uniform(-1.0, 1.0)
            made.run(0.2, held=1.0 + motion / SAG)
            made.measure(made.tip + noise)
            offsets.append(made.status.offset)
        return float(np.std(offsets[50:], axis=0).max())

    assert scatter(0.2e-3) < 1.05 * scatter(0.0)


def test_a_motion_counts_but_for_the_slack_at_each_of_its_turns() -> None:
    change, x = LoadChange(0.5e-3), np.array([1.0, 0.0, 0.0])
    assert [1e3 * change.moved(1e-3 * place * x) for place in (4.0, 4.4, 3.6, 6.0, 8.0, 7.1, 5.0)] == pytest.approx(
        [0.0, 0.0, 0.0, 1.5, 2.0, 0.0, 2.0]
    )


def test_late_measurement_is_compared_with_the_model_of_its_time() -> None:
    made = model()
    late = []
    for _ in range(20):
        made.run(0.1)
        late.append(made.tip)
        made.down = np.array([-np.cos(made.time - START), -np.sin(made.time - START), 0.0])
        if len(late) > 3:
            assert made.measure(late[-4] + 1e-4 * (len(late) % 2), late=0.3), made.observer._refusal
    assert np.linalg.norm(made.status.offset) < 0.5e-3


def test_wrong_stiffness_learnt_in_one_direction_holds_in_another() -> None:
    made = model(model_error=0.15)
    follow(made, 0.1 * SAG * made.down, 4.0)
    made.down = np.array([0.0, 1.0, 0.0])
    made.run(1.0)
    # Nothing is measured in this direction; most of the error is along it.
    assert made.status.offset[1] > 0.6 * 0.1 * SAG


def test_outliers_and_dropouts_do_not_move_the_estimate() -> None:
    made, random = model(), np.random.default_rng(3)
    made.run(0.5, held=1.0)
    follow(made, np.array([1e-3, 0.0, 0.0]), 5.0)
    before = made.status.offset
    for _ in range(2):
        made.run(0.2)
        assert not made.measure(made.tip + np.array([5e-3, 0.0, 0.0]) * random.choice([-1, 1]))
    made.run(3.0)
    np.testing.assert_allclose(made.status.offset, before, atol=0.1e-3)
    assert made.status.state == TrackerState.STALE and "3.4 s" in made.status.sentence


def test_a_tracker_that_is_switched_off_is_no_longer_refused() -> None:
    made = model()
    made.run(0.5)
    for _ in range(30):
        made.run(0.05)
        assert not made.measure(made.tip, frame="optitrack")
    assert made.status.state == TrackerState.REFUSED
    made.run(60.0)
    assert made.status.state == TrackerState.STALE
    assert made.status.sentence.startswith("no measured/tip has come for 60.0 s; the last ones were refused: it is in the frame")


def test_moved_tracker_begins_again() -> None:
    made = model()
    made.run(0.5, held=1.0)
    follow(made, np.array([1e-3, 0.0, 0.0]), 5.0)
    follow(made, np.array([-5e-3, 2e-3, 0.0]), 5.0, seed=1)
    assert made.status.restarts == 1
    np.testing.assert_allclose(made.status.offset, [-5e-3, 2e-3, 0.0], atol=0.5e-3)


def test_a_robot_that_something_holds_is_not_pressed_on_by_the_correction() -> None:
    """The model's tip rises by 6 mm, the robot's stays: it is not corrected by these 6 mm. Later it follows again."""
    made, random = model(), np.random.default_rng(5)
    made.run(0.5, held=1.0)
    follow(made, np.array([1e-3, 0.0, 0.0]), 4.0)
    held = made.tip + np.array([1e-3, 0.0, 0.0])
    for step in range(30):
        made.run(0.2, held=1.0 + 0.02 * min(step, 10))
        made.measure(held + 0.5e-3 * random.standard_normal(3))
    assert made.status.state == TrackerState.REFUSED
    assert "measured and predicted motion disagree at (" in made.status.sentence
    assert "something that the scene does not have there holds the robot" in made.status.sentence
    assert np.linalg.norm(made.status.offset - [1e-3, 0.0, 0.0]) < 1.5e-3
    made.run(1.0, held=1.0)
    follow(made, np.array([1e-3, 0.0, 0.0]), 2.0, seed=2)
    assert made.status.state == TrackerState.USED and not made.status.sentence


def test_an_error_that_drifts_while_the_target_is_held_is_corrected() -> None:
    """The base turns, or the body creeps: the model moves by the correction alone, and the robot stays at its target."""
    made, random = model(), np.random.default_rng(7)
    made.run(0.5, held=1.0)
    follow(made, np.zeros(3), 4.0)
    for step in range(150):
        made.run(0.2)
        made.measure(made.tip + [4e-5 * min(step, 125), 0.0, 0.0] + 0.5e-3 * random.standard_normal(3))
        assert "disagree" not in made.status.sentence
    np.testing.assert_allclose(made.status.offset, [5e-3, 0.0, 0.0], atol=1e-3)


def test_a_robot_that_moves_where_its_model_leans_is_reported() -> None:
    """An obstacle that is not where the scene has it; without one it is a load, which the correction is there for."""
    for touching in (True, False):
        made, random = model(), np.random.default_rng(6)
        made.run(0.5, held=1.0)
        follow(made, np.zeros(3), 4.0)
        made.touching = touching
        for step in range(30):
            made.run(0.2)
            made.measure(made.tip + [-5e-4 * min(step, 12), 0.0, 0.0] + 0.5e-3 * random.standard_normal(3))
        assert ("is not where the scene has it" in made.status.sentence) == touching
        np.testing.assert_allclose(made.status.offset, [-6e-3, 0.0, 0.0], atol=1e-3)


def test_correction_never_exceeds_its_authority() -> None:
    made = model(authority=0.02)
    follow(made, np.array([1.9e-3, 0.0, 0.0]), 5.0, std=0.05e-3)
    made.down = np.array([0.0, 0.0, -1.0])
    made.run(1.0)
    assert np.linalg.norm(made.status.offset) <= 0.02 * ROBOT.length + 1e-12


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda tip: 1000.0 * tip, "in mm"),
        (lambda tip: tip / 1000.0, "1000 times too small"),
        (lambda tip: tip * [-1.0, 1.0, 1.0], "mirrored (left-handed): it fits when read as (-x, y, z)"),
        (lambda tip: tip[[2, 1, 0]], "left-handed"),
        (lambda tip: tip[[2, 0, 1]], "turned: it fits when read as (y, z, x)"),
        (lambda tip: np.add(tip, [1.0, 2.0, 0.5]), "another frame"),
        (lambda tip: np.add(tip, [0.0, 0.02, 0.0]), "20.0 mm from the model's"),
        (lambda tip: tip * np.nan, "finite numbers"),
    ],
)
def test_wild_positions_are_refused_and_named(wrong, named: str) -> None:
    made = model()
    for count in range(4):
        made.run(0.2)
        assert not made.measure(wrong(made.tip) * (1.0 + 1e-4 * count))
    assert made.status.state == TrackerState.REFUSED and named in made.status.sentence
    assert (made.status.offset == 0.0).all()


@pytest.mark.parametrize(
    ("late", "named"),
    [
        (START - 4000.0, "start of a machine"),
        (START + 0.5, "no stamp"),
        (-0.4, "ahead"),
        (1.2, "late"),
    ],
)
def test_wrong_clocks_are_refused_and_named(late: float, named: str) -> None:
    made = model()
    made.time = START + 0.5
    made.measure(made.tip, late=late)
    assert named in made.observer._refusal


def test_arrival_stands_in_for_a_foreign_clock() -> None:
    made = model(stamp="arrival", delay=0.1)
    assert made.observer.measure(17.3, made.time, "soft_base", made.tip)


def test_repeated_poses_are_refused() -> None:
    made = model()
    position, found = made.tip + 1e-4, []
    for _ in range(5):
        made.run(0.2)
        found.append(made.measure(position))
    assert found == [True, True, True, False, False] and "repeats its last pose" in made.observer._refusal


def test_other_frame_is_refused_or_transformed() -> None:
    made = model()
    assert not made.measure(made.tip, frame="world") and "'world'; 'soft_base' is needed" in made.observer._refusal
    other = model(frame="world", position=(1.0, 2.0, 0.5), rpy=(0.0, 0.0, np.pi / 2))
    x, y, z = other.tip - [1.0, 2.0, 0.5]
    assert other.measure(np.array([y, -x, z]), frame="world")


def test_marker_beside_the_tip_is_no_error() -> None:
    made = model(marker=(0.0, 5e-3, 8e-3))
    made.run(0.5, held=1.0)
    follow(made, np.array([0.0, 5e-3, 8e-3]), 3.0)
    assert np.linalg.norm(made.status.offset) < 0.3e-3


def test_mirrored_axis_is_found_by_the_motion() -> None:
    """On the straight robot x and -x differ by nothing; the correction would run away."""
    made = model()
    made.run(0.5, held=0.95)
    rng = np.random.default_rng(4)
    for step in range(20):
        made.run(0.2, held=0.95 + 0.15 * (step % 2))
        made.measure(made.tip * [-1.0, 1.0, 1.0] + 0.2e-3 * rng.standard_normal(3))
    assert made.status.state == TrackerState.REFUSED and "(-x, y, z)" in made.status.sentence
    assert np.linalg.norm(made.status.offset) < 1e-3


def test_a_robot_that_lags_is_not_taken_for_an_error() -> None:
    made = model()
    made.run(0.5, held=1.0)
    follow(made, np.zeros(3), 4.0)
    start = made.tip
    made.run(0.1, held=0.8)
    made.measure(start)  # 100 ms behind
    made.run(0.5)
    assert np.linalg.norm(made.status.offset) < 0.5e-3


def test_virtual_tracker_measures_at_its_rate_late_and_loses_some() -> None:
    @dataclasses.dataclass
    class Truth:
        time: float
        tip_position: np.ndarray
        tip_orientation: np.ndarray

    def measured(seed: int):
        tracker = VirtualTracker(VirtualTrackerParameters(rate=5.0, delay=0.1, dropouts=0.2, outliers=0.1), ROBOT.length, seed)
        return [(t, m) for t in np.arange(0.0, 100.0, 0.01) for m in tracker.observe(Truth(t, REST, UPRIGHT))]

    found = measured(1)
    assert 370 < len(found) < 430
    assert all(0.1 - 1e-6 <= t - m.time < 0.1 + 0.011 for t, m in found)
    errors = np.array([np.linalg.norm(m.position - REST) for _, m in found])
    assert 0.06 < (errors > 3e-3).mean() < 0.14
    assert np.sqrt(np.mean(errors[errors < 3e-3] ** 2) / 3) == pytest.approx(0.5e-3, rel=0.1)
    assert all((a.position == b.position).all() for (_, a), (_, b) in zip(found, measured(1)))


def test_options_are_checked() -> None:
    with pytest.raises(ConfigError, match=r"tracker.*position.*2 numbers; 3 are needed"):
        from_mapping(TipObserverOptions, {"position_mm": [1.0, 2.0]}, source="robot.yaml", key="tracker")


@pytest.fixture(scope="module")
def setup() -> Setup:
    return with_wrong_model(Setup.of(load_robot_file("article")), 0.85)


def held(setup: Setup, seconds: float, tracker: VirtualTrackerParameters | None) -> ClosedLoop:
    loop = ClosedLoop(setup, StaticMotion(base_orientation(0.0)), tracker=tracker)
    loop.hold(straight_target(setup.robot.length, tip_direction_weight=setup.direction_weight))
    loop.run(seconds)
    return loop


def test_commands_stay_the_same_while_no_measurement_arrives(setup: Setup, monkeypatch, tmp_path) -> None:
    # A cache of its own: another process may store the reduced model between the two runs.
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path))
    without, lost = (held(setup, 0.3, tracker) for tracker in (None, VirtualTrackerParameters(rate=5.0, dropouts=1.0)))
    # But for rounding: ProxQP adds in an order that depends on where its memory begins.
    assert np.abs(without.trace.command - lost.trace.command).max() < 1e-10


@pytest.mark.slow
def test_tracker_removes_the_error_of_a_wrong_model(setup: Setup) -> None:
    loop = held(setup, 3.5, VirtualTrackerParameters(rate=5.0))
    last = loop.trace.between(loop.time - 1.0)
    model_error = np.linalg.norm((last.tip_position - last.model_tip_position)[:, :2], axis=1).mean()
    error = np.linalg.norm(last.tip_position[:, :2], axis=1).mean()
    assert model_error > 0.5e-3 and error < 0.6 * model_error
