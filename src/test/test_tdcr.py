"""The robot with nine tendons as a chain with friction: derivatives, friction, what is left out, other tables."""

import csv
import dataclasses

import numpy as np
import pytest

from gravcomp.calibration.chain import Chain
from gravcomp.calibration.csv_table import CsvTable
from gravcomp.experiments.measured import tdcr
from gravcomp.experiments.measured.tdcr_fit import ChainFit, _derivative, fit
from gravcomp.experiments.measured.tdcr_model import COUNT, SERVOS, UNKNOWNS, Pulls, bends, play, predict, read, tips

HEADER = ["timestamp", "pattern_label", *(f"servo_{i}_mm" for i in SERVOS), "tip_x", "tip_y", "tip_z"]


def true_x() -> np.ndarray:
    """Unknowns with friction and straight pieces between disks."""
    x = 0.3 * np.random.default_rng(5).normal(size=COUNT)
    start = 0
    for name, unknown in UNKNOWNS.items():
        fixed = {"shortening": 2.0, "lag": 0.5, "friction": 0.6, "stiffness": 0.1}.get(name)
        if fixed is not None:
            x[start : start + len(unknown.names)] = fixed
        start += len(unknown.names)
    return x


def ramps(labels: tuple[str, ...], seed: int = 0) -> Pulls:
    """Patterns that go out and back along a direction of the nine servos."""
    random, rows = np.random.default_rng(seed), []
    for label in labels:
        way = 3e-3 * random.normal(size=9)
        rows += [(label, share * way) for share in (0.1, 0.4, 0.7, 1.0, 0.8, 0.5, 0.2)]
    displacement = 1e-5 * np.round(1e5 * np.array([row for _, row in rows]))
    moved = np.stack([play(column[:, None], 2e-5)[:, 0] for column in displacement.T], axis=1)
    pattern = np.array([label for label, _ in rows])
    return Pulls(pattern, displacement, np.zeros((len(rows), 3)), moved, np.zeros((len(rows), 3, 2)))


def simulated(labels: tuple[str, ...], noise: float = 0.0, seed: int = 0) -> Pulls:
    pulls, x = ramps(labels, seed), true_x()
    tip = predict(x, pulls.with_path(x)) + noise * np.random.default_rng(9).normal(size=pulls.tip.shape)
    return dataclasses.replace(pulls, tip=tip)


LABELS = tuple(f"{kind}_dir{angle}" for kind in ("seg1", "seg2", "pair12_same") for angle in (0, 60, 120, 180, 240, 300))


def write(path, pulls: Pulls, order=None) -> None:
    rows = [[0.5 * i, pulls.pattern[i], *(1e3 * pulls.displacement[i]), *(1e3 * pulls.tip[i])] for i in range(len(pulls.tip))]
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([HEADER, *(rows if order is None else [rows[i] for i in order])])


def test_tendons_that_run_straight_from_disk_to_disk_shorten_by_their_chords():
    """Against the polygon: n gaps of an arc, with a tendon at the side to which it bends."""
    length, radius, gaps, bend = 0.06, 4.5e-3, 4, 1.2
    chord = 2 * gaps * (length / bend - radius) * np.sin(bend / gaps / 2)
    chain = Chain(np.array([length]), radius, 0.0, np.zeros(1, dtype=int), length / (24 * gaps**2))
    found, _ = chain.bends(np.array([[length - chord]]), np.zeros(1), 1e12)
    # The tendon's lever is that of an arc, longer by the share (bend / gaps)^2 / 24 = 0.4 % than that of the polygon.
    assert found[0, 0] == pytest.approx([bend * (1 - (bend / gaps) ** 2 / 24), 0.0], abs=1e-3)
    without, _ = dataclasses.replace(chain, shortening=0.0).bends(np.array([[length - chord]]), np.zeros(1), 1e12)
    assert without[0, 0, 0] > bend + 0.04


def test_a_play_remembers_the_way():
    path = np.array([0.0, 0.5, 3.0, 2.5, 1.0, 0.9])[:, None]
    assert play(path, 1.0)[:, 0] == pytest.approx([0.0, 0.5, 1.0, 0.5, -1.0, -1.0])


def test_derivatives_agree_with_difference_quotients():
    pulls, x = simulated(LABELS[:4]), true_x()
    pulls = pulls.with_path(x)
    bent = bends(x, pulls)
    found = _derivative(x, pulls, bent).reshape(*pulls.tip.shape, COUNT)
    for entry, step in enumerate(1e-4 * np.eye(COUNT)):
        expected = (tips(x + step, bends(x + step, pulls, bent)) - tips(x - step, bends(x - step, pulls, bent))) / 2e-4
        off = np.abs(found[..., entry] - expected).max(axis=1)
        assert np.median(off) < 1e-2 * max(np.abs(expected).max(), 1e-4), entry  # single rows: a tendon becomes slack


def test_a_fit_predicts_patterns_that_it_has_not_seen_with_their_friction():
    pulls = simulated(LABELS, 0.5e-3)
    seen = np.array([not label.endswith(("dir120", "dir300")) for label in pulls.pattern])
    found = fit(pulls, seen)
    error = found.predict(pulls, ~seen) - pulls.tip[~seen]
    assert np.sqrt((error**2).sum(axis=1).mean()) < 3e-3
    still = dataclasses.replace(pulls, moved=0 * pulls.moved)
    plain = predict(found.x, still) - pulls.tip
    assert np.sqrt((plain[~seen] ** 2).sum(axis=1).mean()) > 1.5 * np.sqrt((error**2).sum(axis=1).mean())


def test_a_table_is_read_in_its_order_in_time_and_held_poses_belong_to_their_pattern(tmp_path):
    pulls = simulated(("rep1_seg1_dir0", "rep1_seg1_dir0_hold", "rep2_seg1_dir0", "tendon3_id5_pull"))
    order = np.random.default_rng(1).permutation(len(pulls.tip))
    write(tmp_path / "a.csv", pulls)
    write(tmp_path / "b.csv", pulls, order)
    plain, shuffled = read(CsvTable.read(tmp_path / "a.csv")), read(CsvTable.read(tmp_path / "b.csv"))
    assert set(plain.pattern) == {"seg1_dir0", "tendon3_id5_pull"} and plain.single.sum() == 7
    for field in dataclasses.fields(Pulls):
        assert (getattr(plain, field.name) == getattr(shuffled, field.name)).all()
    assert np.abs(plain.moved).max() == pytest.approx(1.0)


def test_other_tables_of_the_folder_are_predicted_by_the_fit_to_the_first(tmp_path, monkeypatch):
    """Here the fit is the truth, so that only the way through the tables can be wrong."""
    monkeypatch.setattr(tdcr, "fit", lambda *_: ChainFit(true_x(), true_x(), np.zeros(COUNT)))
    kept = simulated(("seg3_dir0", "pair13_opp_dir60"), seed=8)
    write(tmp_path / "tdcr" / "train.csv", simulated(LABELS))
    write(tmp_path / "tdcr" / "kept.csv", kept, np.random.default_rng(2).permutation(len(kept.tip)))
    (tmp_path / "tdcr" / "columns.csv").write_text("column,unit\ntip_x,mm\n", encoding="utf-8")  # a table of something else
    part = tdcr.evaluate(tmp_path / "tdcr", lambda stage: None, False)
    assert list(part.data["tdcr_other_tables_mm"]) == ["kept.csv"]
    assert part.data["tdcr_other_tables_mm"]["kept.csv"] < 1e-3
    assert any("kept.csv, predicted by the fit to train.csv" in figure.name for figure in part.figures)
    assert set(part.data["tdcr_held_out_mm"]) == {"patterns", "kinds of patterns", "directions"}
