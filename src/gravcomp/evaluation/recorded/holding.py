"""How well a recorded robot kept its shape: released and held, at rest and on the way."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import STILL_GRAVITY, STILL_TIME, STILL_TIP
from gravcomp.config import ConfigError
from gravcomp.evaluation import metrics
from gravcomp.evaluation.recorded.run import BETWEEN, HELD, RELEASED, Course, RecordedRun
from gravcomp.report.drawing import MODEL, REAL, TARGET, WITHOUT, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table

_SAME_POSE = np.radians(10.0)  # directions of gravity that count as one pose
_BAND = 0.5e-3  # m: converged when the tip stays within it


@dataclass(frozen=True)
class _Rest:
    """One stretch at rest: its rows, its phase, the mean direction of gravity, and the mean errors."""

    rows: np.ndarray
    phase: int
    down: np.ndarray
    errors: metrics.TipErrors


def run(recorded: RecordedRun) -> Result:
    """The judgement. Raises ConfigError when the bag holds no time at which the robot was held."""
    course = recorded.course
    held, released = (course.phase == phase for phase in (HELD, RELEASED))
    if not held.any():
        raise ConfigError(f"{recorded.bag}: the controller never kept a target in it; record while it does")
    errors = errors_of(course)
    rests = _rests(course)
    at_rest = np.concatenate([rest.rows for rest in rests]) if rests else np.zeros(0, int)
    judged = course.phase != BETWEEN
    kept = [rest.errors for rest in rests if rest.phase == HELD]
    with_, without = _rms(errors.distance[held]), _rms(errors.distance[released])
    figures = [
        Figure("recovery rate r at rest", _recovery(course, at_rest), "", "> 0.99", 0.999, True, 6),
        Figure("r with the way between", _recovery(course, np.flatnonzero(judged)), "", "> 0.99", digits=5),
        Figure("largest lateral residual at rest, held", 1e3 * max((e.lateral for e in kept), default=np.nan), "mm", limit=1.0),
        Figure("largest tilt of the tip at rest, held", float(np.degrees(max((e.tilt for e in kept), default=np.nan))), "deg"),
        Figure("tip error held, RMS over all the time", 1e3 * with_, "mm"),
    ]
    if released.any():
        figures += [
            Figure("tip error released, RMS over all the time", 1e3 * without, "mm"),
            Figure("tip error smaller than released by the factor", without / with_, "", limit=5.0, at_least=True),
            Figure(
                "time to converge after the release ended, longest",
                _longest_convergence(course, errors.distance),
                "s",
                "about 6 s",
            ),
        ]
    return Result(
        name="holding",
        title="Keeping the shape, recorded",
        question=f"How well did the {recorded.who} keep the shape that was asked of it?",
        ground=recorded.ground,
        figures=figures,
        parts=[
            Plot(
                "Tip over time",
                _drawing(course, errors),
                f"Distance of the {recorded.who}'s tip from its target, and from the model's tip.",
            ),
            _table(rests),
        ],
        parameters={"bag": str(recorded.bag), "samples": len(course.time), "seconds": float(course.time[-1])},
        notes=[
            f"At rest: {STILL_TIME:g} s during which the tip stays within {1e3 * STILL_TIP:g} mm and gravity within {np.degrees(STILL_GRAVITY):g} deg; the last such of every"
            " stretch counts. r correlates modelled and measured tip, the three coordinates centred one by one.",
            *(
                []
                if released.any()
                else [
                    "The cables were never released, so there is nothing to compare with: call ~/relax for a while at each pose."
                ]
            ),
        ],
    )


def errors_of(course: Course) -> metrics.TipErrors:
    """Of the measured tip from the target, (t,) each."""
    return metrics.tip_errors(course.tip_position, course.tip_direction, course.target_position, course.target_direction)


def _rests(course: Course) -> list[_Rest]:
    """The last window at rest of every stretch between two movements, changes of phase or of target."""
    count = max(2, round(STILL_TIME / max(float(np.median(np.diff(course.time))), 1e-6)))
    rests, last = [], None
    for start in range(0, len(course.time) - count + 1, max(1, count // 2)):
        rows = np.arange(start, start + count)
        rest = _rest(course, rows)
        if last is not None and (rest is None or rest.phase != last.phase):
            rests.append(last)
        last = rest
    return rests + ([last] if last is not None else [])


def _rest(course: Course, rows: np.ndarray) -> _Rest | None:
    window = course.rows(rows)
    down = window.gravity / np.linalg.norm(window.gravity, axis=1, keepdims=True)
    still = (
        window.phase[0] != BETWEEN
        and (window.phase == window.phase[0]).all()
        and np.ptp(window.tip_position, axis=0).max() <= STILL_TIP
        and np.ptp(down, axis=0).max() <= STILL_GRAVITY
        and np.ptp(window.target_position, axis=0).max() == 0.0
    )
    if not still:
        return None
    return _Rest(rows, int(window.phase[0]), down.mean(axis=0), metrics.means(errors_of(window)))


def _table(rests: list[_Rest]) -> Table:
    rows = []
    for rest in (r for r in rests if r.phase == HELD):
        before = [r for r in rests if r.phase == RELEASED and metrics.angle_between(r.down, rest.down) < _SAME_POSE]
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
        "Released at the same direction of gravity, where the recording has that. 0°: the robot lies horizontally; 90°: it points up.",
    )


def _recovery(course: Course, rows: np.ndarray) -> float:
    if len(rows) < 2:
        return float("nan")
    return metrics.recovery_rate(course.tip_position[rows], course.model_tip_position[rows])


def _longest_convergence(course: Course, distance: np.ndarray) -> float:
    """s, over all changes from released to held whose stretch is still to the end."""
    changes = np.flatnonzero((course.phase[1:] == HELD) & (course.phase[:-1] == RELEASED)) + 1
    times = []
    for start in changes:
        ends = np.flatnonzero(course.phase[start:] != HELD)
        end = start + ends[0] if len(ends) else len(course.time)
        if end - start > 2:
            part = slice(start, end)
            times.append(metrics.settling_time(course.time[part], distance[part], start=course.time[start], band=_BAND))
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
        model.set_ylabel("tip to the model's tip in mm")
        for axes in drawing.axes:
            axes.set_xlabel("time in s")
        error.legend()
    return drawing.svg
