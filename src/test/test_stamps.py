"""Stamps that cannot be used as they are: the result says what stands in, and no command ends in a traceback."""

import json

import numpy as np
import pytest
from bag_of_topics import TopicBag
from rosbags.rosbag2 import StoragePlugin

from gravcomp.commands.__main__ import main
from gravcomp.recordings.imu import Recording, RecordingError, read_recording
from gravcomp.recordings.imu.stamps import usable_stamps

RANDOM = np.random.default_rng(1)
EVEN = 10**9 + 10_000_000 * np.arange(200)
VALUES = RANDOM.normal(size=(200, 6))


def write_bag(path, stamps, received, storage=StoragePlugin.SQLITE3):
    with TopicBag(path, storage) as bag:
        for k, (stamp, reception) in enumerate(zip(stamps, received)):
            bag.imu("/imu/data_raw", stamp, (0.01 * (k % 7), 0, 0), (0, 0.01 * (k % 5), 9.81), late=reception - stamp)
    return path


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GRAVCOMP_CACHE", str(tmp_path / "cache"))


def test_good_stamps_stay_as_they_are():
    stamps, notes = usable_stamps(EVEN, EVEN + 5, VALUES)
    assert (stamps == EVEN).all() and not notes


@pytest.mark.parametrize("value", [0, 77])
def test_for_stamps_that_are_all_the_same_the_times_of_reception_stand_in(value):
    stamps, notes = usable_stamps(np.full(200, value), EVEN, VALUES)
    assert (stamps == EVEN).all() and "times of reception stand in" in notes[0]


def test_some_zero_stamps_are_replaced_by_the_times_of_reception_less_the_usual_delay():
    stamps, notes = usable_stamps(np.where(np.arange(200) % 10 == 3, 0, EVEN), EVEN + 3_000_000, VALUES)
    assert (stamps == EVEN).all() and "20 stamps are zero" in notes[0]


@pytest.mark.parametrize("length", [2, 10])
def test_a_burst_is_spread_evenly(length):
    last = np.minimum(np.arange(200) // length * length + length - 1, 199)
    stamps, notes = usable_stamps(EVEN[last], EVEN[last], VALUES)
    assert np.abs(stamps - EVEN).max() <= 1 and f"up to {length}" in notes[0]


def test_repeated_samples_are_not_a_burst():
    twice = np.repeat(np.arange(100), 2)
    stamps, notes = usable_stamps(EVEN[twice], None, VALUES[twice])
    assert (stamps == EVEN[twice]).all() and not notes


@pytest.mark.parametrize("unit", [1, 1_000, 1_000_000])
def test_a_32_bit_counter_that_wraps_is_continued(unit):
    whole = (EVEN // 1_000_000 * 1_000_000) + 2**32 * unit - 10**9 - 10**9
    stamps, notes = usable_stamps(whole % (2**32 * unit), None, VALUES)
    assert (np.diff(stamps) == 10_000_000).all() and "32-bit" in notes[0]


@pytest.mark.parametrize("burst", [None, 10])
def test_a_bag_with_such_stamps_is_estimated(tmp_path, capsys, burst):
    received = 100.0 + 0.01 * np.arange(300)
    stamps = np.zeros(300) if burst is None else received[np.arange(300) // burst * burst + burst - 1]
    bag = write_bag(tmp_path / "bag", stamps, received)
    assert read_recording(bag).rate == pytest.approx(100.0, rel=1e-3)
    assert main(["estimate", str(bag), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["rejected"] == 0 and any("reception" in text or "bursts" in text for text in figures["problems"])


def test_a_bag_that_was_cut_off_says_so(tmp_path, capsys):
    received = 100.0 + 0.01 * np.arange(7000)  # several chunks
    bag = write_bag(tmp_path / "bag", received, received, StoragePlugin.MCAP)
    file = next(bag.glob("*.mcap"))
    content = file.read_bytes()
    file.write_bytes(content[: 2 * len(content) // 3])
    assert main(["estimate", str(bag), "--json"]) == 0
    assert any("damaged" in text for text in json.loads(capsys.readouterr().out)["problems"])


def test_stamps_that_never_advance_are_refused_by_every_command(tmp_path, capsys):
    with pytest.raises(RecordingError, match="do not advance"):
        Recording("x", np.zeros(3, np.int64), np.zeros((3, 3)), np.ones((3, 3)))
    bag = write_bag(tmp_path / "bag", np.zeros(50), np.zeros(50))
    for command in (["estimate"], ["calibrate-imu"]):
        assert main([*command, str(bag)]) == 2
        assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("pace", [0.5, 1.0, 2.0])
def test_stamps_of_another_pace_than_the_reception_are_named(tmp_path, pace):
    received = 100.0 + 0.01 * np.arange(1200)
    notes = read_recording(write_bag(tmp_path / "bag", 50.0 + pace * 0.01 * np.arange(1200), received)).notes
    assert [f"{pace:.2f} times as fast as the times of reception" in note for note in notes] == ([] if pace == 1.0 else [True])
