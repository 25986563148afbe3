"""Report of a fit to poses: the fitted table, measured and predicted markers, and the error of every pose."""

from collections.abc import Sequence

import numpy as np

from gravcomp.calibration.pose_fit import PoseEstimate, PoseFit
from gravcomp.calibration.poses import Poses
from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table


def pose_result(poses: Poses, fit: PoseFit, written: str) -> Result:
    """Return the result for `report.write_report`."""
    error = 1e3 * np.sqrt(((fit.predicted - poses.measured) ** 2).sum(axis=2).mean(axis=1))
    return Result(
        name="calibration",
        title="Calibration to poses",
        question=f"Fit to {poses.source}; written to {written}.",
        ground="Computation in the core: full static model. Intervals hold at 95 %.",
        figures=[
            Figure("marker error before, RMS", 1e3 * fit.rms_before, "mm"),
            Figure("marker error after, RMS", 1e3 * fit.rms, "mm", "", 1e3 * fit.rms_before),
            Figure("evaluations", fit.evaluations, ""),
        ],
        parts=[
            fitted_table("Parameters", fit.estimates),
            views("Markers", poses.measured, fit.predicted, "Measured and predicted markers of all poses after the fit."),
            error_bars("Error by pose", poses.name, {"fitted": error}, "Root mean square over the markers."),
        ],
        notes=[
            "Gains, zeros and the offset of the base belong to the measurement and are reported here only; the robot file"
            " contains modulus and cables.",
            *fit.open,
        ],
        data={"parameters": [vars(e) for e in fit.estimates], "not_shown": list(fit.open)},
    )


def fitted_table(title: str, estimates: Sequence[PoseEstimate], note: str = "") -> Table:
    """Return the table of what was fitted."""
    rows = [
        (
            e.name, f"{e.initial:.4g} {e.unit}".strip(), f"{e.value:.4g} {e.unit}".strip(),
            f"± {e.interval:.2g} {e.unit}".strip() if np.isfinite(e.interval) else "–",
        )
        for e in estimates
    ]  # fmt: skip
    return Table(title, ("parameter", "described", "fitted", "interval at 95 %"), rows, note)


def views(title: str, measured: np.ndarray, predicted: np.ndarray, caption: str, planes: tuple[str, ...] = ("xz", "yz")) -> Plot:
    """Return measured and predicted places (k, p, 3) in m, seen along two axes, with lines from one to the other."""
    with Drawing(1, len(planes), width=4.8 * len(planes), height=4.2) as drawing:
        for axes, plane in zip(np.atleast_1d(drawing.axes), planes):
            a, b = ("xyz".index(axis) for axis in plane)
            real, model = 1e3 * measured.reshape(-1, 3), 1e3 * predicted.reshape(-1, 3)
            for one, other in zip(real, model):
                axes.plot([one[a], other[a]], [one[b], other[b]], color="#9aa3ad", linewidth=0.8)
            axes.plot(real[:, a], real[:, b], "o", color=REAL, ms=3.5, label="measured")
            axes.plot(model[:, a], model[:, b], "x", color=MODEL, ms=4, label="predicted")
            axes.set_aspect("equal")
            axes.set_xlabel(f"{plane[0]} in mm")
            axes.set_ylabel(f"{plane[1]} in mm")
        np.atleast_1d(drawing.axes)[0].legend()
    return Plot(title, drawing.svg, caption)


def error_bars(title: str, names: Sequence[str], series: dict[str, np.ndarray], caption: str) -> Plot:
    """Return errors in mm of the poses `names` as bars, one series for each entry."""
    with Drawing(width=9.5, height=2.8) as drawing:
        places, width = np.arange(len(names)), 0.8 / len(series)
        for number, (label, values) in enumerate(series.items()):
            drawing.axes.bar(places + (number - 0.5 * (len(series) - 1)) * width, values, width, label=label)
        drawing.axes.set_xticks(places, names, rotation=45 if len(names) > 6 else 0, ha="right" if len(names) > 6 else "center")
        drawing.axes.set_ylabel("error in mm")
        drawing.axes.legend()
    return Plot(title, drawing.svg, caption)
