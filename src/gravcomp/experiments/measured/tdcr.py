"""A robot of three segments with nine tendons through disks: angles, zeros, gains and stiffness of the tendons are fitted.

The fit uses the chain of constant curvatures (`calibration.chain`), whose bends have a closed form once the taut tendons are
known: 1600 poses are too many for the full model.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gravcomp.calibration.chain import Chain
from gravcomp.calibration.measured import MeasurementError, rms_distance
from gravcomp.calibration.pose_fit import PoseEstimate
from gravcomp.calibration.pose_report import error_bars, fitted_table, views
from gravcomp.experiments.measured.folder_table import folder_table
from gravcomp.experiments.measured.part import Part
from gravcomp.report.result import Figure

SERVOS = (4, 3, 9, 5, 2, 8, 6, 1, 7)  # three a segment, from the base
CHAIN = Chain(np.array([60e-3, 62.5e-3, 64e-3]), 4.5e-3, 8e-3, np.repeat([0, 1, 2], 3))
CONSTANT_CURVATURE = 7.0  # mm: with eleven fitted parameters, without the single pulls
_NOISE = 4e-3  # m
_FOLDS = 5
# Entries of x with their unit, the size of one unit of x in SI, and what x = 0 stands for.
_ANGLES = np.radians([190.0, -145.0, -120.0])  # of the first tendon of each segment; from the columns of a linear fit
_SIZES = np.concatenate(
    [np.full(3, np.radians(10.0)), np.full(9, 0.1), np.full(9, 1e-3), [1.0], np.full(3, 0.1), np.full(3, 5e-3)]
)
_NAMES = (
    *(f"angle of segment {i}" for i in (1, 2, 3)),
    *(f"gain of servo {number}" for number in SERVOS),
    *(f"zero of servo {number}" for number in SERVOS),
    "tendon stiffness, logarithm",
    *(f"base rotation {axis}" for axis in "xyz"),
    *(f"base position {axis}" for axis in "xyz"),
)
_START = np.log(4.0e6)  # 1/m^3: stiffness of the tendons over the bending stiffness


@dataclasses.dataclass(frozen=True)
class Pulls:
    """Rows of the table: pattern (k,), displacement (k, 9) and tip (k, 3) in m."""

    pattern: np.ndarray
    displacement: np.ndarray
    tip: np.ndarray

    @property
    def single(self) -> np.ndarray:
        """Which rows are pulls of a single tendon (k,)."""
        return np.array(["tendon" in pattern for pattern in self.pattern])

    def rows(self, which: np.ndarray) -> "Pulls":
        """Return some rows."""
        return Pulls(self.pattern[which], self.displacement[which], self.tip[which])


def read(folder: Path) -> Pulls:
    """Read the table of a folder. Raises MeasurementError."""
    table = folder_table(folder, "train.csv")
    servos, tip = [f"servo_{number}_mm" for number in SERVOS], [f"tip_{axis}" for axis in "xyz"]
    table.require(["pattern_label", *servos, *tip])
    return Pulls(np.array(table.texts("pattern_label")), table.vectors(servos, 1e-3), table.vectors(tip, 1e-3))


def angles(x: np.ndarray) -> np.ndarray:
    """Return the angles (9,) of the tendons in rad."""
    return (np.repeat(_ANGLES + x[:3] * _SIZES[:3], 3)) + np.tile(np.radians([0.0, 120.0, 240.0]), 3)


def predict(x: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Return the tips (k, 3) in m."""
    from scipy.spatial.transform import Rotation

    value = x * _SIZES
    driven = displacement * (1.0 + value[3:12]) + value[12:21]
    bends, _ = CHAIN.bends(driven, angles(x), float(np.exp(_START + value[21])))
    return Rotation.from_rotvec(value[22:25]).apply(CHAIN.tips(bends)) + value[25:28]


def fit(pulls: Pulls, start: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return x, and the half widths of its intervals at 95 %."""
    from scipy.optimize import least_squares

    prior = np.array([0.0] * 3 + [1.0] * 9 + [1.0 / 3.0] * 9 + [0.0] + [0.5] * 6)

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.concatenate([(predict(x, pulls.displacement) - pulls.tip).ravel() / _NOISE, prior * x])

    solution = least_squares(residuals, np.zeros(len(_SIZES)) if start is None else start, xtol=1e-4, ftol=1e-5, max_nfev=40)
    misfit = solution.fun[: pulls.tip.size]
    variance = float(misfit @ misfit) / max(1, misfit.size - len(_SIZES))
    data = solution.jac[: pulls.tip.size]
    half = 1.96 * np.sqrt(np.diag(np.linalg.pinv(data.T @ data / variance + np.diag(prior**2))))
    return solution.x, half


def repeatability(pulls: Pulls, near: float = 0.3e-3) -> float:
    """Return the standard deviation in m of tips whose nine commands differ by at most `near` in m, from their pairs."""
    pairs = np.abs(pulls.displacement[:, None] - pulls.displacement[None]).max(axis=2) < near
    one, other = np.nonzero(np.triu(pairs, 1))
    return float(np.sqrt(((pulls.tip[one] - pulls.tip[other]) ** 2).sum(axis=1).mean() / 2)) if len(one) else float("nan")


def evaluate(folder: Path, progress: Callable[[str], None], brief: bool) -> Part:
    """Fit to all poses, with five-fold cross-validation by whole patterns."""
    pulls = read(folder)
    if brief:
        pulls = pulls.rows(np.arange(len(pulls.tip)) % 5 == 0)
    progress("fit to all poses")
    x, half = fit(pulls)
    patterns = np.array(sorted(set(pulls.pattern)))
    if len(patterns) < _FOLDS or pulls.single.all():
        raise MeasurementError(
            f"{folder}: contains {len(patterns)} patterns of pulls, {len(set(pulls.pattern[~pulls.single]))} of them of several"
            f" tendons; at least {_FOLDS} are needed, and one of several tendons"
        )
    fold_of = dict(zip(patterns, np.random.default_rng(0).permutation(np.arange(len(patterns)) % _FOLDS)))
    fold = np.array([fold_of[pattern] for pattern in pulls.pattern])
    predicted = np.empty_like(pulls.tip)
    for number in range(_FOLDS):
        progress(f"fold {number + 1} of {_FOLDS}")
        other, _ = fit(pulls.rows(fold != number), x)
        predicted[fold == number] = predict(other, pulls.displacement[fold == number])
    several, left_out = pulls.rows(~pulls.single), predicted[~pulls.single]
    wrong = left_out - several.tip
    inside = predict(x, several.displacement)
    alone = rms_distance((predicted - pulls.tip)[pulls.single]) if pulls.single.any() else float("nan")
    same = repeatability(several)
    scatters = {
        "tdcr: pulls of single tendons, five-fold, RMSE": alone,
        "tdcr: repeatability, tips of equal commands, standard deviation": same,
    }
    group = np.array([pattern.split("_")[1] if "_" in pattern else pattern for pattern in several.pattern])
    groups = sorted(set(group))
    factor = np.concatenate(
        [np.full(3, 180 / np.pi), np.ones(9), np.full(9, 1e3), [1.0], np.full(3, 180 / np.pi), np.full(3, 1e3)]
    )
    unit = ["deg"] * 3 + [""] * 9 + ["mm"] * 9 + [""] + ["deg"] * 3 + ["mm"] * 3
    base = np.concatenate([_ANGLES, np.ones(9), np.zeros(9), [_START], np.zeros(6)])
    estimates = [
        PoseEstimate(name, u, f * b, f * (b + v * size), f * h * size)
        for name, u, f, b, v, size, h in zip(_NAMES, unit, factor, base, x, _SIZES, half)
    ]
    return Part(
        figures=[
            Figure(
                "tdcr: tip, without pulls of single tendons, five-fold, RMSE",
                1e3 * rms_distance(wrong),
                "mm",
                f"{CONSTANT_CURVATURE:g} mm, fitted constant curvature",
                4.0,
            ),
            Figure("tdcr: tip, fitted, RMSE", 1e3 * rms_distance(inside - several.tip), "mm"),
            *(Figure(name, 1e3 * value, "mm") for name, value in scatters.items() if np.isfinite(value)),
        ],
        parts=[
            views(
                "Nine tendons: tips",
                several.tip[::10, None],
                left_out[::10, None],
                "Every tenth pose, predicted by the fit to other patterns.",
            ),
            error_bars(
                "Nine tendons: error by pattern",
                groups,
                {"left out of the fit": np.array([1e3 * rms_distance(wrong[group == name]) for name in groups])},
                "Root mean square over the poses of each kind of pattern.",
            ),
            fitted_table("Nine tendons: fitted", estimates),
        ],
        notes=[
            "tdcr: tips of equal commands (within 0.3 mm)"
            f" {f'scatter by {1e3 * same:.1f} mm' if np.isfinite(same) else 'scatter'}: friction and the order of the pulls,"
            " which a model of the resting shape does not contain. Backlash of 0.3 mm and more between servo and tendon made the"
            " fit worse.",
            "tdcr: the fit uses a chain of constant curvatures with elastic tendons that only pull, not the full model.",
        ],
        data={
            "tdcr_mm": 1e3 * rms_distance(wrong),
            "tdcr_single_mm": 1e3 * alone,
            "tdcr_repeatability_mm": 1e3 * same,
        },
    )
