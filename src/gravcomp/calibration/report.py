"""Report of a calibration: fitted parameters with their intervals, warnings, and the tips before and after."""

import datetime

import numpy as np

from gravcomp.calibration.fit import StaticFit
from gravcomp.calibration.measured import Measured
from gravcomp.calibration.motion import MotionFit
from gravcomp.report.drawing import MODEL, REAL, REST, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table


def calibration_result(
    source: str, written: str, statics: StaticFit, motion: MotionFit | None, courses: list[Measured], initial_damping: float
) -> Result:
    """Return the result for `report.write_report`. courses: those of the fit `motion`; initial_damping in s."""
    rows = [
        (
            e.name,
            f"{e.initial:.4g} {e.unit}".strip(),
            f"{e.value:.5g} {e.unit}".strip() if e.seen or not e.reason else "kept",
            f"± {e.interval:.2g} {e.unit}".strip(),
            e.seen,
        )
        for e in statics.estimates
    ]
    figures = [
        Figure("tip error at rest before, RMS", 1e3 * statics.rms_before, "mm"),
        Figure("tip error at rest after, RMS", 1e3 * statics.rms_after, "mm", "", 1e3 * statics.rms_before),
        Figure("tip error that the noise leaves open, RMS", 1e3 * statics.open_error, "mm"),
        *(
            []
            if statics.sag is None
            else [Figure("the same, of the released robot's sag", 100.0 * statics.open_error / statics.sag, "%")]
        ),
        Figure("evaluations at rest", statics.evaluations, ""),
    ]
    parts: list = [
        Plot(
            "Resting tips, measured and modelled",
            _tips(statics),
            "Measured against modelled tip, both relative to the straight robot's.",
        )
    ]
    warnings = list(statics.warnings)
    if motion is not None:
        rows.append(
            (
                "damping time",
                f"{1e3 * initial_damping:.4g} ms",
                f"{1e3 * motion.damping_time:.4g} ms" if motion.damping_seen else "kept",
                f"± {1e3 * motion.damping_interval:.2g} ms" if motion.damping_seen else "",
                motion.damping_seen,
            )
        )
        if np.isfinite(motion.creep_ratio_interval):
            creep = (
                ("creep ratio", motion.creep_ratio, motion.creep_ratio_interval, ""),
                ("creep time", motion.creep_time, motion.creep_time_interval, "s"),
            )
            rows += [
                (name, "–", f"{value:.3g} {unit}".strip(), f"± {interval:.2g} {unit}".strip(), bool(interval < value))
                for name, value, interval, unit in creep
            ]
            if motion.creep_ratio_interval > motion.creep_ratio:
                warnings.append("creep: these data do not show any; leave --creep out")
        if not motion.damping_seen:
            warnings.append("damping time: these data contain too little motion to determine it; the robot file's is kept")
        if motion.rms_before is None:
            warnings.append("tip error in motion before: the motion of the robot as it is described cannot be computed")
        else:
            figures.append(Figure("tip error in motion before, RMS", 1e3 * motion.rms_before, "mm"))
        figures.append(Figure("tip error in motion after, RMS", 1e3 * motion.rms_after, "mm"))
        parts.append(
            Plot("Motion", _motion(courses, motion), "The trial with the most motion, measured and modelled after the fit.")
        )
    return Result(
        name="calibration",
        title="Calibration",
        question=f"Fit to {source}; written to {written}.",
        ground="Computation in the core: full static model, and the model in motion for the damping. Intervals hold at 95 %.",
        figures=figures,
        parts=[Table("Parameters", ("parameter", "before", "after", "interval", "seen in the data"), rows), *parts],
        notes=[
            *warnings,
            *(
                ["The density is taken as given: gravity bends the robot by density over modulus, so tips cannot tell both."]
                if "density" not in statics.fitted
                else []
            ),
        ],
        data={
            "parameters": [vars(e) for e in statics.estimates],
            "tip_error_before_mm": 1e3 * statics.rms_before,
            "tip_error_after_mm": 1e3 * statics.rms_after,
            "open_error_mm": 1e3 * statics.open_error,
            "sag_mm": None if statics.sag is None else 1e3 * statics.sag,
            "damping_time_ms": None
            if motion is None or not motion.damping_seen
            else [1e3 * motion.damping_time, 1e3 * motion.damping_interval],
            "warnings": warnings,
        },
    )


def origin_of(source: str, data: str, statics: StaticFit) -> dict:
    """Return where calibrated values are from: date, data, residuals, and each value with its interval at 95 %."""
    values = {}
    for e in statics.estimates:
        unit = f" {e.unit}".rstrip()
        found = f"{e.value:.5g} +- {e.interval:.2g}{unit}"
        unseen = f"{e.initial:.5g}{unit}, kept: {e.reason}" if e.reason else f"{found}, hardly seen in the data"
        values[e.name] = found if e.seen else unseen
    return {
        "date": datetime.date.today().isoformat(),
        "robot": source,
        "data": data,
        "rests": round(float(statics.windows.shares.sum())),
        "tip_error_before_mm": round(1e3 * statics.rms_before, 4),
        "tip_error_after_mm": round(1e3 * statics.rms_after, 4),
        "values_at_95_percent": values,
    }


def _tips(fit: StaticFit) -> str:
    """Return the drawing of the resting tips as SVG."""
    rest = np.array([0.0, 0.0, fit.windows.tip_position[:, 2].max()])
    measured = 1e3 * (fit.windows.tip_position - rest)
    with Drawing(1, 3, width=10.5, height=3.5) as drawing:
        for axes, k, name in zip(drawing.axes, range(3), "xyz"):
            span = [measured[:, k].min() - 1, measured[:, k].max() + 1]
            axes.plot(span, span, color=REST, linewidth=1.0)
            for prediction, colour, label in ((fit.before, MODEL, "before"), (fit.after, REAL, "after")):
                axes.plot(
                    measured[:, k], 1e3 * (prediction.tip[:, :3] - rest)[:, k], "o", color=colour, ms=4, alpha=0.8, label=label
                )
            axes.set_xlabel(f"{name} measured in mm")
            axes.set_ylabel(f"{name} modelled in mm")
        drawing.axes[0].legend()
    return drawing.svg


def _motion(courses: list[Measured], fit: MotionFit) -> str:
    """Return the drawing of the course with the most motion as SVG."""
    index = max(range(len(courses)), key=lambda k: np.ptp(courses[k].tip_position, axis=0).max())
    course, predicted = courses[index], fit.predicted[index]
    axis = int(np.argmax(np.ptp(course.tip_position, axis=0)))
    with Drawing(width=9.0, height=3.0) as drawing:
        drawing.axes.plot(course.time, 1e3 * course.tip_position[:, axis], color=REAL, label="measured")
        drawing.axes.plot(course.time, 1e3 * predicted[:, axis], color=MODEL, label="modelled", linewidth=1.1)
        drawing.axes.set_xlabel("time in s")
        drawing.axes.set_ylabel(f"tip {'xyz'[axis]} in mm")
        drawing.axes.legend()
    return drawing.svg
