"""A robot of three segments with nine tendons through disks: angles, zeros, gains, stiffness and friction are fitted.

The fit uses the chain of constant curvatures with friction (`tdcr_model`): 1600 poses are too many for the full model. What it
predicts is left out of the fit by whole patterns, by whole kinds of patterns (all of one segment, all of one pair of segments)
and by whole directions; other tables of the folder are predicted by the fit to `train.csv`.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.csv_table import CsvTable
from gravcomp.calibration.measured import MeasurementError, rms_distance
from gravcomp.calibration.pose_fit import PoseEstimate
from gravcomp.calibration.pose_report import error_bars, fitted_table, views
from gravcomp.experiments.measured.folder_table import folder_table
from gravcomp.experiments.measured.part import Part
from gravcomp.experiments.measured.tdcr_fit import ChainFit, fit
from gravcomp.experiments.measured.tdcr_model import CHAIN, COLUMNS, UNKNOWNS, Pulls, read, values
from gravcomp.report.result import Figure

CONSTANT_CURVATURE = 7.0  # mm: with eleven fitted parameters, without the single pulls
_FOLDS = 5
_LAST = re.compile(r"_(dir\d+|circle)$")  # of a pattern's name, behind its kind


def repeatability(pulls: Pulls, near: float = 0.3e-3) -> float:
    """Return the standard deviation in m of tips whose nine commands differ by at most `near` in m, from their pairs."""
    pairs = np.abs(pulls.displacement[:, None] - pulls.displacement[None]).max(axis=2) < near
    one, other = np.nonzero(np.triu(pairs, 1))
    return float(np.sqrt(((pulls.tip[one] - pulls.tip[other]) ** 2).sum(axis=1).mean() / 2)) if len(one) else float("nan")


def left_out(pulls: Pulls, names: np.ndarray, start: ChainFit, what: str, progress: Callable[[str], None]) -> np.ndarray:
    """Return the tips (k, 3) predicted by fits to the rows of other names; names (k,), in five folds, of `what`."""
    distinct = np.unique(names)
    fold_of = dict(zip(distinct, np.random.default_rng(0).permutation(np.arange(len(distinct)) % _FOLDS)))
    fold = np.array([fold_of[name] for name in names])
    predicted = np.empty_like(pulls.tip)
    for number in np.unique(fold):
        progress(f"{what}, fold {number + 1} of {fold.max() + 1}")
        predicted[fold == number] = fit(pulls, fold != number, start).predict(pulls, fold == number)
    return predicted


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool) -> Part:
    """Fit to all poses of the table, and predict what is left out (brief: of every fifth pose, by patterns alone)."""
    table = folder_table(folder, "train.csv")
    pulls = read(table)
    if brief:
        pulls = pulls.rows(np.arange(len(pulls.tip)) % 5 == 0)
    patterns, several = np.unique(pulls.pattern), ~pulls.single
    if len(patterns) < _FOLDS or not several.any():
        raise MeasurementError(
            f"{folder}: contains {len(patterns)} patterns of pulls, {len(set(pulls.pattern[several]))} of them of several"
            f" tendons; at least {_FOLDS} are needed, and one of several tendons"
        )
    progress("fit to all poses")
    whole = fit(pulls, np.ones(len(pulls.tip), dtype=bool))
    inside = whole.predict(pulls)
    kind = np.array(["tendon" if alone else _LAST.sub("", name) for name, alone in zip(pulls.pattern, pulls.single)])
    by_pattern = left_out(pulls, pulls.pattern, whole, "patterns", progress)
    error = {"patterns": by_pattern - pulls.tip}
    for what, names in (("kinds of patterns", kind), ("directions", np.array([name.split("_")[-1] for name in pulls.pattern]))):
        if not brief and len(np.unique(names[several])) > 1:
            predicted = left_out(pulls, names, whole, what, progress)
            error[what] = predicted - pulls.tip
    held = {what: 1e3 * rms_distance(wrong[several]) for what, wrong in error.items()}
    alone = 1e3 * rms_distance(error["patterns"][pulls.single]) if pulls.single.any() else float("nan")
    same = 1e3 * repeatability(pulls.rows(several))
    main = "tdcr: tip, without pulls of single tendons, five-fold, RMSE"
    figures = [
        Figure(main, held["patterns"], "mm", f"{CONSTANT_CURVATURE:g} mm, fitted constant curvature", 4.0),
        *(
            Figure(f"tdcr: the same, whole {what} left out, RMSE", value, "mm", "", 4.0)
            for what, value in held.items()
            if what != "patterns"
        ),
        Figure("tdcr: tip, fitted, RMSE", 1e3 * rms_distance((inside - pulls.tip)[several]), "mm"),
    ]
    others = {other.path.name: other_table(other, whole) for other in _others(table)}
    figures += [Figure(f"tdcr: {name}, predicted by the fit to {table.path.name}, RMSE", v, "mm") for name, v in others.items()]
    scatters = {
        "tdcr: pulls of single tendons, five-fold, RMSE": alone,
        "tdcr: repeatability, tips of equal commands, standard deviation": same,
    }
    figures += [Figure(name, value, "mm") for name, value in scatters.items() if np.isfinite(value)]
    kinds = sorted(set(kind[several]))
    bars = {
        f"whole {what} left out": np.array([1e3 * rms_distance(wrong[kind == name]) for name in kinds])
        for what, wrong in error.items()
    }
    return Part(
        figures=figures,
        parts=[
            views(
                "Nine tendons: tips",
                pulls.tip[several][::10, None],
                by_pattern[several][::10, None],
                "Every tenth pose, predicted by the fit to other patterns.",
            ),
            error_bars(
                "Nine tendons: error by kind of pattern", kinds, bars, "Root mean square over the poses of each kind of pattern."
            ),
            fitted_table("Nine tendons: fitted", _estimates(whole)),
        ],
        notes=[
            "tdcr: the fit uses a chain of constant curvatures with elastic tendons that only pull, run straight from disk to"
            " disk and have dry friction, not the full model. The order of the poses in time decides the friction."
            f" The shortening between disks is that of {_gaps(whole):.1f} gaps in each segment.",
        ],
        data={
            "tdcr_mm": held["patterns"],
            "tdcr_held_out_mm": held,
            "tdcr_other_tables_mm": others,
            "tdcr_single_mm": alone,
            "tdcr_repeatability_mm": same,
        },
    )


def other_table(table: CsvTable, whole: ChainFit) -> float:
    """Return the root mean square error in mm of another table, without the pulls of single tendons where there are others."""
    pulls = read(table)
    if not len(pulls.tip):
        raise MeasurementError(f"{table.path}: contains no rows below its header")
    error = whole.predict(pulls) - pulls.tip
    return 1e3 * rms_distance(error if pulls.single.all() else error[~pulls.single])


def _others(table: CsvTable) -> list[CsvTable]:
    """Return the other tables of the folder of a table that have pulls and tips."""
    paths = sorted(other for other in table.path.parent.glob("*.csv") if other != table.path)
    return [other for other in map(CsvTable.read, paths) if set(COLUMNS) <= set(other.header)]


def _estimates(whole: ChainFit) -> list[PoseEstimate]:
    """Return what is fitted, with its intervals."""
    found, place = [], 0
    for name, change in values(whole.x).items():
        unknown = UNKNOWNS[name]
        for label, described, change_of in zip(unknown.names, unknown.described, change):
            half = unknown.factor * unknown.size * float(whole.half[place])
            found.append(
                PoseEstimate(
                    label, unknown.unit, unknown.factor * described, unknown.factor * (described + float(change_of)), half
                )
            )
            place += 1
    return found


def _gaps(whole: ChainFit) -> float:
    """Return the number of gaps between disks in a segment of mean length that the shortening stands for; NaN for none."""
    shortening = float(values(whole.x)["shortening"][0])
    return float(np.sqrt(CHAIN.length.mean() / (24.0 * shortening))) if shortening > 0.0 else float("nan")
