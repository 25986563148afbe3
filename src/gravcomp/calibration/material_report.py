"""Report of a fit to a relaxation or creep test: the terms with their intervals, and the course, measured and fitted."""

from gravcomp.calibration.material_recording import MaterialTest
from gravcomp.calibration.prony_fit import SeriesFit
from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table


def material_result(test: MaterialTest, fit: SeriesFit, written: str) -> Result:
    """Return the result for `report.write_report`."""
    rows = [
        (
            number,
            f"{fitted.term.share:.4g}",
            f"± {fitted.share_interval:.2g}",
            f"{fitted.term.time:.4g} s",
            f"{fitted.time_limits[0]:.3g} to {fitted.time_limits[1]:.3g} s",
        )
        for number, fitted in enumerate(fit.terms, start=1)
    ]
    with Drawing(width=6.0, height=3.6) as drawing:
        axes = drawing.axes
        axes.semilogx(test.time, test.value / fit.predicted[-1], ".", color=REAL, ms=3, label="measured")
        axes.semilogx(test.time, fit.predicted / fit.predicted[-1], color=MODEL, linewidth=1.2, label="fitted")
        axes.set_xlabel("time in s")
        axes.set_ylabel(f"{test.column}, over its last value")
        axes.legend()
    return Result(
        name="calibration",
        title="Calibration of the material",
        question=f"Prony series from the {test.what} in {test.source}; written to {written}.",
        ground="A Maxwell branch for each term, in addition to the long-term stiffness. Intervals hold at 95 %.",
        figures=[
            Figure(f"{test.what}: what remains after the fit, RMS", 100.0 * fit.error, "%"),
            Figure("terms", len(fit.terms), ""),
        ],
        parts=[
            Table(
                "Prony series",
                ("term", "share", "interval", "time", "interval of the time"),
                rows,
                "Shares of the instantaneous stiffness. Young's modulus of the robot file stays the long-term one.",
            ),
            Plot(test.what.capitalize(), drawing.svg, "The course over the logarithm of the time."),
        ],
        notes=list(fit.notes),
        data={
            "prony": [
                {
                    "share": f.term.share,
                    "share_interval": f.share_interval,
                    "time_s": f.term.time,
                    "time_limits_s": list(f.time_limits),
                }
                for f in fit.terms
            ]
        },
    )
