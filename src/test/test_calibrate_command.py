"""`gravcomp calibrate`: from a CSV file and from a bag to the robot's YAML, with intervals, warnings and a page."""

import json
from pathlib import Path

import numpy as np
import pytest
from bag_of_topics import TopicBag

from gravcomp.calibration.files import read_measured, write_csv
from gravcomp.calibration.measured import Measured, MeasurementError, StillWindows, still_windows
from gravcomp.calibration.standstill import Standstill
from gravcomp.closed_loop.setup import Setup
from gravcomp.commands.__main__ import main
from gravcomp.description import load_robot_file
from gravcomp.trials.free_fall import free_fall
from gravcomp.trials.known_robot import known_setup, known_windows

pytestmark = pytest.mark.slow

MODULUS = 0.6e6  # Pa
LOOSE = -0.03  # m
KEPT = ("--no-places", "--no-weight", "--no-mount", "--no-friction")
STILL = Standstill.of(load_robot_file("article").robot, 0.28)


@pytest.fixture(scope="module")
def setup():
    return known_setup(Setup.of(load_robot_file("article")), MODULUS)


@pytest.fixture(scope="module")
def windows(setup):
    """One pose with each cable pulled in in turn."""
    return known_windows(setup, ((0.0, 0.0),))


def standing(windows: StillWindows, first: int = 0) -> list[Measured]:
    """A trial of 0.6 s a window, sampled at 20 Hz."""
    trials = []
    for number, window in enumerate(
        zip(windows.gravity, windows.displacement, windows.tip_position, windows.tip_direction), start=first
    ):
        rows = 13
        trials.append(
            Measured(
                "here",
                np.full(rows, number),
                0.05 * np.arange(rows),
                *(np.tile(value, (rows, 1)) for value in window),
            )
        )
    return trials


def joined(trials: list[Measured]) -> Measured:
    """Concatenate trials to one measurement."""
    columns = {
        name: np.concatenate([getattr(trial, name) for trial in trials])
        for name in ("trial", "time", "gravity", "displacement", "tip_position", "tip_direction")
    }
    return Measured(source=trials[0].source, **columns)


@pytest.fixture(scope="module")
def first_cable(windows):
    """The windows of one pose in which no cable but the first is taut."""
    rows = [k for k, command in enumerate(windows.displacement) if np.isnan(command[1:]).all()]
    return StillWindows(
        windows.gravity[rows], windows.displacement[rows], windows.tip_position[rows], windows.tip_direction[rows]
    )


@pytest.fixture(scope="module")
def measured(setup, windows):
    """Resting tips under 13 states of the cables, and one free fall."""
    fall = free_fall((setup, 20.0, 0.0, 0.5, 0))
    return joined([fall, *standing(windows, first=1)])


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def calibrate(capsys, *arguments: str) -> dict:
    assert main(["calibrate", *arguments, "--write", "mine.yaml", "--out", "pages", "--workers", "1", "--json", *KEPT]) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def check(result: dict, setup: Setup) -> None:
    """Check that the known robot is found, that the page shows it, and that the YAML is a robot."""
    found = {p["name"]: p for p in result["data"]["parameters"]}
    moduli = [found[f"Young's modulus of {name}"] for name in ("proximal", "distal")]
    for modulus in moduli:
        assert modulus["value"] == pytest.approx(MODULUS * 1e-6, rel=0.02)
        assert 0.0 < modulus["interval"] < 0.05 * modulus["value"]
    damping, interval = result["data"]["damping_time_ms"]
    assert damping == pytest.approx(1e3 * setup.truth.body.damping_time, rel=0.05)
    assert 0.0 < interval < 0.2 * damping
    figures = {f["name"]: f["value"] for f in result["figures"]}
    assert figures["tip error at rest after, RMS"] < 0.1 * figures["tip error at rest before, RMS"]
    # Both use the modulus from rest: only the damping differs. Noise of the camera and the difference of the models remain.
    assert figures["tip error in motion after, RMS"] < 0.5 * figures["tip error in motion before, RMS"]
    page = Path("pages/calibration.html").read_text(encoding="utf-8")
    assert page.count("<svg") >= 2 and "Resting tips, measured and modelled" in page
    mine = load_robot_file("mine.yaml")
    written = [segment.material.youngs_modulus for segment in mine.robot.segments]
    assert written == pytest.approx([modulus["value"] * 1e6 for modulus in moduli], rel=1e-4)
    text = Path("mine.yaml").read_text(encoding="utf-8")
    assert "# Calibrated on" in text and "base: coarse.yaml" in text and "values_at_95_percent" in text
    assert mine.robot.segments[1].material.damping_time == pytest.approx(damping * 1e-3, rel=1e-3)


def test_a_csv_file_becomes_a_calibrated_robot(here, capsys, measured, setup):
    """In a coarser mesh, in which the tip sags by 0.5 % more: the fit takes half of the time."""
    write_csv(measured, here / "tips.csv", load_robot_file("article").robot.cable_names)
    Path("coarse.yaml").write_text("base: article\nrobot:\n  elements: {around: 4, along: 8}\n", encoding="utf-8")
    result = calibrate(capsys, "tips.csv", "--robot", "coarse.yaml")
    check(result, setup)
    motors = load_robot_file("mine.yaml").hardware.motors
    offsets = {f"offset of {m.cable}": 1e3 * m.offset for m in motors}
    found = {p["name"]: p["value"] for p in result["data"]["parameters"] if p["name"] in offsets}
    assert len(found) == 6 and found == pytest.approx({name: offsets[name] for name in found}, abs=1e-4)


def test_a_bag_contains_what_a_csv_file_does(here, measured):
    cables = load_robot_file("article").robot.cable_names
    write_csv(measured, here / "tips.csv", cables)
    write_bag(here / "bag", measured)
    from_csv, from_bag = (read_measured(name, cables) for name in ("tips.csv", "bag"))
    assert np.unique(from_bag.trial).size == np.unique(from_csv.trial).size
    fall, same_fall = from_csv.trials()[0], from_bag.trials()[0]
    tip = [np.interp(same_fall.time, fall.time, fall.tip_position[:, axis]) for axis in range(3)]
    np.testing.assert_allclose(same_fall.tip_position.T, tip, atol=1e-6)
    rest, same_rest = still_windows(from_csv, STILL), still_windows(from_bag, STILL)
    for name in ("gravity", "tip_position"):
        np.testing.assert_allclose(getattr(same_rest, name), getattr(rest, name), atol=1e-5)
    np.testing.assert_allclose(same_rest.displacement, np.nan_to_num(rest.displacement, nan=LOOSE), atol=1e-7)


def test_a_bag_becomes_a_calibrated_robot(here, capsys, first_cable):
    write_bag(here / "bag", joined(standing(first_cable)))
    found = {p["name"]: p["value"] for p in calibrate(capsys, "bag")["data"]["parameters"]}
    assert found["Young's modulus of proximal"] == pytest.approx(MODULUS * 1e-6, rel=0.02)
    assert "base: article" in Path("mine.yaml").read_text(encoding="utf-8")
    assert load_robot_file("mine.yaml").robot.segments[0].material.youngs_modulus == pytest.approx(MODULUS, rel=0.02)


def test_parameters_that_the_data_do_not_show_are_reported(here, capsys, first_cable):
    """Only the first cable is ever taut, in one pose: five offsets are invisible, and so is the damping."""
    write_csv(joined(standing(first_cable)), here / "tips.csv", load_robot_file("article").robot.cable_names)
    result = calibrate(capsys, "tips.csv")
    notes = " ".join(result["notes"])
    assert "s1c2, s1c3, s2c1, s2c2, s2c3: never taut in these data" in notes
    assert "no trial contains fast motion" in notes
    assert result["data"]["damping_time_ms"] is None
    assert (
        load_robot_file("mine.yaml").robot.segments[0].material.damping_time
        == load_robot_file("article").robot.segments[0].material.damping_time
    )


def test_unusable_data_end_in_a_sentence(here, capsys):
    assert main(["calibrate", "nowhere.csv"]) != 0
    assert "nowhere.csv: does not exist" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"clock": -1.7e9}, "'/measured/tip' are 1.7e.09 s behind those of gravity .do they count from the start of a machine"),
        ({"clock": 5.0}, "'/measured/tip' are 5 s ahead of those of gravity; synchronise"),
        ({"lost": np.nan}, "'/measured/tip' has values that are not finite numbers"),
        ({"lost": 0.0}, "13 poses whose orientation is no quaternion"),
    ],
)
def test_a_bag_of_another_clock_or_without_numbers_is_refused(here, first_cable, change, message):
    write_bag(here / "bag", joined(standing(first_cable)[:2]), **change)
    with pytest.raises(MeasurementError, match=message):
        read_measured("bag", load_robot_file("article").robot.cable_names)


def test_the_length_of_the_specific_force_is_that_of_imu_data_in_a_bag_and_stays_in_a_table(here):
    cables = load_robot_file("article").robot.cable_names
    with TopicBag(here / "bag") as bag:
        for time in np.arange(1.0, 3.0, 0.1):
            bag.vector("/gravity", time, [-9.8, 0.0, 0.0])
            bag.state("/cable/state", time, np.zeros(len(cables)))
            bag.pose("/measured/tip", time, [0.0, 0.0, 0.1])
            bag.imu("/imu/data", time, np.zeros(3), [0.0, 6.0, 8.0 + 0.1 * time])
    found = read_measured("bag", cables)
    assert found.specific_force == pytest.approx(np.hypot(6.0, 8.0 + 0.1 * (found.time - found.time[0] + 1.0)), abs=1e-3)
    write_csv(found, here / "table.csv", cables)
    assert read_measured("table.csv", cables).specific_force == pytest.approx(found.specific_force, abs=1e-4)


def write_bag(path: Path, measured: Measured, clock: float = 0.0, lost: float | None = None) -> None:
    """Write the measurement as topics of the graph, two seconds between trials; released cables are paid out.

    truth/gravity must not be taken for gravity. clock: of the tracker, ahead of the robot's in s; lost: orientation of the tips
    of the first trial.
    """
    with TopicBag(path) as bag:
        start = max(0.0, -clock)
        trials = measured.trials()
        for trial in trials:
            for time, gravity, wound, tip, (x, y, z) in zip(
                start + trial.time - trial.time[0],
                trial.gravity,
                trial.displacement,
                trial.tip_position,
                trial.tip_direction,
            ):
                bag.vector("/gravity", time, gravity)
                bag.vector("/truth/gravity", time, gravity)
                bag.state("/cable/state", time, np.nan_to_num(wound, nan=LOOSE))
                half = np.array([-y, x, 0.0, 1.0 + z])  # of the shortest turn of the z axis to the direction
                turn = half / np.linalg.norm(half)
                if lost is not None and trial is trials[0]:
                    turn = np.full(4, lost)
                bag.pose("/measured/tip", time + clock, tip, turn, late=-clock)
            start += trial.time[-1] - trial.time[0] + 2.0
