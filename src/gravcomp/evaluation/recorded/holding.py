"""Error of a recorded robot to its target: released and held, at rest and in motion."""

import numpy as np

from gravcomp.calibration.standstill import Standstill
from gravcomp.config import ConfigError
from gravcomp.evaluation import metrics
from gravcomp.evaluation.recorded.course import BETWEEN, HELD, RELEASED, Course
from gravcomp.evaluation.recorded.rests import Rest, errors_of, rests
from gravcomp.evaluation.recorded.run import RecordedRun
from gravcomp.full_model.modes import first_period
from gravcomp.report.drawing import MODEL, REAL, TARGET, WITHOUT, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table

_SAME_POSE = np.radians(10.0)  # largest difference of two directions of gravity that count as one pose


def run(recorded: RecordedRun) -> Result:
    """Return the evaluation. Raises ConfigError when the controller keeps a target at no time in the bag."""
    course = recorded.course
    held, released = (course.phase == phase for phase in (HELD, RELEASED))
    if not held.any():
        raise ConfigError(f"{recorded.bag}: the controller never keeps a target in it; record while it does")
    errors = errors_of(course)
    robot = recorded.setup.robot
    still = Standstill.of(robot, first_period(robot))
    found = rests(course, still)
    at_rest = np.concatenate([rest.rows for rest in found]) if found else np.zeros(0, int)
    kept = [rest.errors for rest in found if rest.phase == HELD]
    with_, without = _rms(errors.distance[held]), _rms(errors.distance[released])
    figures = [
        Figure("recovery rate r at rest", _recovery(course, at_rest), "", "> 0.99", 0.999, True, 6),
        Figure("r at rest and in motion", _recovery(course, np.flatnonzero(course.phase != BETWEEN)), "", "> 0.99", digits=5),
        Figure(
            "largest lateral error at rest, held", 1e3 * max((e.lateral for e in kept), default=float("nan")), "mm", limit=1.0
        ),
        Figure(
            "largest tilt of the tip at rest, held", float(np.degrees(max((e.tilt for e in kept), default=float("nan")))), "deg"
        ),
        Figure("tip error held, RMS over the whole time", 1e3 * with_, "mm"),
    ]
    if released.any():
        figures += [
            Figure("tip error released, RMS over the whole time", 1e3 * without, "mm"),
            Figure("tip error smaller than released by the factor", without / with_, "", limit=5.0, at_least=True),
            Figure(
                "time to converge after the release ended, longest",
                _longest_convergence(course, errors.distance, metrics.CONVERGED * robot.length),
                "s",
                "about 6 s",
            ),
        ]
    return Result(
        name="holding",
        title="Keeping the shape, recorded",
        question=f"How close was the {recorded.who} to its target shape?",
        ground=recorded.ground,
        figures=figures,
        parts=[
            Plot(
                "Tip over time",
                _drawing(course, errors),
                f"Distance of the {recorded.who}'s tip from its target, and from the model's tip.",
            ),
            _table(found),
        ],
        parameters={"bag": str(recorded.bag), "samples": len(course.time), "seconds": float(course.time[-1])},
        notes=[
            f"At rest: {still.time:.2g} s during which the tip stays within"
            f" {1e3 * still.tip_limit(course.tip_position):.2g} mm and gravity within {np.degrees(still.gravity):g} deg; the last"
            " such window of every stretch counts. r is the correlation of the"
            " modelled and the measured tip, each coordinate centred on its own mean.",
            *(
                []
                if released.any()
                else ["The cables were never released, so there is no comparison: call ~/relax for some seconds at each pose."]
            ),
        ],
    )


def _table(found: list[Rest]) -> Table:
    rows = []
    for rest in (r for r in found if r.phase == HELD):
        before = [r for r in found if r.phase == RELEASED and metrics.angle_between(r.down, rest.down) < _SAME_POSE]
        e = rest.errors
        without = f"{1e3 * before[-1].errors.distance:.2f}" if before else "–"
        rows.append(
            (
                f"{metrics.inclination_deg(rest.down):.0f}°",
                without,
                1e3 * e.distance,
                1e3 * e.lateral,
                1e3 * e.axial,
                float(np.degrees(e.tilt)),
            )
        )
    header = ("inclination of the base", "tip error released, mm", "held, mm", "lateral, mm", "axial, mm", "tilt, deg")
    return Table(
        "At rest",
        header,
        rows,
        "Released: at the same direction of gravity, if the recording has it. 0°: the robot is horizontal; 90°: it points up.",
    )


def _recovery(course: Course, rows: np.ndarray) -> float:
    if len(rows) < 2:
        return float("nan")
    return metrics.recovery_rate(course.tip_position[rows], course.model_tip_position[rows])


def _longest_convergence(course: Course, distance: np.ndarray, band: float) -> float:
    """Return the longest time (s) from released to held until the error stays within `band` (m); NaN without any."""
    changes = np.flatnonzero((course.phase[1:] == HELD) & (course.phase[:-1] == RELEASED)) + 1
    times = []
    for start in changes:
        ends = np.flatnonzero(course.phase[start:] != HELD)
        end = start + ends[0] if len(ends) else len(course.time)
        if end - start > 2:
            part = slice(start, end)
            times.append(metrics.settling_time(course.time[part], distance[part], start=course.time[start], band=band))
    return float(np.nanmax(times)) if np.isfinite(times).any() else float("nan")


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")


def _drawing(course: Course, errors: metrics.TipErrors) -> str:
    with Drawing(1, 2, width=10.5, height=3.2) as drawing:
        error, model = drawing.axes
        for phase, colour, label in ((RELEASED, WITHOUT, "released"), (HELD, REAL, "held")):
            shown = np.where(course.phase == phase, 1e3 * errors.distance, np.nan)
            error.plot(course.time, shown, color=colour, label=label)
        error.axhline(0.0, color=TARGET, linewidth=1.0)
        error.set_ylabel("tip error in mm")
        model.plot(course.time, 1e3 * np.linalg.norm(course.tip_position - course.model_tip_position, axis=1), color=MODEL)
        model.set_ylabel("distance to the model's tip in mm")
        for axes in drawing.axes:
            axes.set_xlabel("time in s")
        error.legend()
    return drawing.svg
