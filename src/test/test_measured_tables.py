"""Tables of measurements: rows and columns in any order, parts of them, other names; what is missing is named."""

import csv

import numpy as np
import pytest

from gravcomp.calibration.measured import MeasurementError
from gravcomp.commands.__main__ import main
from gravcomp.experiments import measured
from gravcomp.experiments.measured import disks, rod_wrench, tdcr
from gravcomp.experiments.measured.beam_recording import read as read_recording
from gravcomp.experiments.measured.folder_table import folder_table
from gravcomp.experiments.measured.part import Part
from gravcomp.report.result import Figure

STATIONS = ("seg1_s01", "seg1_s02", "seg2_s01", "seg2_s02")
LINES = ("EulX", "EulY", "EulZ", "Px", "Py", "Pz")


def write(path, rows, seed=None):
    """Write a table; with a seed, its rows below the header and its columns are permuted."""
    if seed is not None:
        rng = np.random.default_rng(seed)
        order, below = rng.permutation(len(rows[0])), rng.permutation(len(rows) - 1) + 1
        rows = [[rows[i][j] for j in order] for i in (0, *below)]
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)


def rod_table():
    """Two shapes under gravity; the second one with a force at the tip."""
    rows = [["rowLabel", "gravity", "mid_wrench", "tip_wrench", *STATIONS], ["arclength", 0, 0.06, 0.3, 0, 1, 0, 1]]
    for name, force in (("s007", 0.0), ("s012", 0.4)):
        for k, line in enumerate(LINES):
            gravity = -9.81 if line == "Pz" else 0.0
            rows.append([f"{line}_{name}", gravity, 0, force if line == "Py" else 0, 0, 0.1, 0.1, 0.1 * (k + 1)])
    return rows


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_a_rods_shapes_do_not_depend_on_the_order_of_rows_and_columns(tmp_path, seed):
    write(tmp_path / "rod" / "statics.csv", rod_table(), seed)
    shapes, incomplete = rod_wrench.read(tmp_path / "rod")
    found = {shape.name: shape for shape in shapes}
    assert set(found) == {"s007", "s012"} and not incomplete
    assert found["s007"].gravity == pytest.approx([0.0, -9.81, 0.0]) and not found["s007"].wrenches
    (wrench,) = found["s012"].wrenches
    assert wrench.force == pytest.approx([0.4, 0.0, 0.0]) and wrench.station == 1.0
    assert found["s012"].tip == pytest.approx([0.5, 0.6, 0.4])


def test_a_rods_shape_without_all_its_lines_is_left_out(tmp_path):
    rows = [row for row in rod_table() if row[0] not in ("arclength", "Px_s007")]
    write(tmp_path / "rod" / "statics.csv", rows)
    shapes, incomplete = rod_wrench.read(tmp_path / "rod")
    assert [shape.name for shape in shapes] == ["s012"] and incomplete == ["s007"]


def beam_table():
    """A beam that is held for 0.5 s and hangs 10 mm lower afterwards."""
    rows = [["time_s", *(f"tip{i}_{axis}_mm" for i in (1, 2, 3) for axis in "xyz")]]
    for time in np.arange(0.0, 5.0, 0.01):
        low = 10.0 * min(1.0, max(0.0, (time - 0.5) / 0.1))
        rows.append([time, *(value - (low if j % 3 == 0 else 0.0) for j, value in enumerate(range(70, 79)))])
    return rows


def test_a_recording_does_not_depend_on_the_order_of_rows_and_columns(tmp_path):
    write(tmp_path / "beam" / "load75_c.csv", beam_table())
    plain = read_recording(tmp_path / "beam" / "load75_c.csv")
    write(tmp_path / "beam" / "load75_c.csv", beam_table(), seed=4)
    permuted = read_recording(tmp_path / "beam" / "load75_c.csv")
    assert plain.mass == permuted.mass == pytest.approx(75e-3)
    assert permuted.markers == pytest.approx(plain.markers) and permuted.time == pytest.approx(plain.time)
    assert (plain.rest - plain.held)[:, 0] == pytest.approx(-10e-3)


def test_instants_at_which_a_marker_is_mistaken_are_left_out(tmp_path):
    rows = beam_table()
    write(tmp_path / "beam" / "gravity_c.csv", rows)
    plain = read_recording(tmp_path / "beam" / "gravity_c.csv")
    for line in (3, 480):
        rows[line][2] += 50.0
    write(tmp_path / "beam" / "gravity_c.csv", rows)
    found = read_recording(tmp_path / "beam" / "gravity_c.csv")
    assert found.mistaken == 2 and len(found.time) == len(plain.time) - 2
    assert found.rest == pytest.approx(plain.rest, abs=1e-9) and found.held == pytest.approx(plain.held, abs=1e-9)


def loose(rows):
    """Rows in which one marker moves about."""
    return [rows[0], *([*row[:4], row[4] + 5.0 * np.sin(i), *row[5:]] for i, row in enumerate(rows[1:]))]


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("gravity_c", loose, "the markers do not keep their distances"),
        ("weight_c", lambda rows: rows, "begins with neither gravity nor load"),
        ("gravity_c", lambda rows: [row[:-1] for row in rows], "column 'tip3_z_mm' is missing"),
        ("gravity_c", lambda rows: [*rows[:9], [0.08, "", *rows[9][2:]], *rows[10:]], "line 10: tip1_x_mm is empty"),
        ("gravity_c", lambda rows: [rows[0], *rows[48:]], "begins 0.0"),
        ("gravity_c", lambda rows: rows[:200], "ends 1.4"),
    ],
)
def test_a_recording_that_cannot_be_used_is_refused(tmp_path, name, change, words):
    write(tmp_path / "beam" / f"{name}.csv", change(beam_table()))
    with pytest.raises(MeasurementError, match=words):
        read_recording(tmp_path / "beam" / f"{name}.csv")


def test_the_only_table_of_a_folder_is_taken_under_any_name(tmp_path):
    write(tmp_path / "x" / "half.csv", [["a"], [1]])
    assert folder_table(tmp_path / "x", "whole.csv").texts("a") == ["1"]
    write(tmp_path / "x" / "other.csv", [["a"], [2]])
    with pytest.raises(MeasurementError, match=r"found: half\.csv, other\.csv"):
        folder_table(tmp_path / "x", "whole.csv")


@pytest.mark.parametrize(
    ("evaluate", "rows", "words"),
    [
        (disks.evaluate, [["case", "model"], [1, "straight_between_disks"]], "column 'length1_m' is missing"),
        (tdcr.evaluate, [["pattern_label", "tip_x", "tip_y", "tip_z"], ["a", 1, 2, 3]], "column 'servo_4_mm' is missing"),
        (tdcr.evaluate, [["pattern_label"]], "contains no rows"),
    ],
)
def test_a_table_with_other_columns_is_refused(tmp_path, evaluate, rows, words):
    write(tmp_path / "x" / "table.csv", rows)
    with pytest.raises(MeasurementError, match=words):
        evaluate(tmp_path / "x", lambda stage: None, True)


def test_a_folder_that_cannot_be_used_takes_no_other_with_it(tmp_path, monkeypatch, capsys):
    def evaluate(folder, progress, brief):
        return Part([Figure("rod", 0.1, "%", limit=0.3)])

    monkeypatch.setattr(rod_wrench, "evaluate", evaluate)
    write(tmp_path / "data" / "x", [])
    (tmp_path / "data" / "disks").mkdir()
    (tmp_path / "data" / "rod_wrench").mkdir()
    result = measured.run(tmp_path / "data")
    assert [figure.name for figure in result.figures] == ["rod"] and len(result.failures) == 1
    assert main(["reproduce", "measured", str(tmp_path / "data"), "--out", str(tmp_path / "out"), "--json"]) == 2
    printed = capsys.readouterr()
    assert '"failures": ["' in printed.out and "tips.csv does not exist" in printed.err
