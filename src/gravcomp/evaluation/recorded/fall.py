"""Free falls of a recorded robot against the fall of the model (see falls.py)."""

import numpy as np

from gravcomp.calibration.course import STRAIGHT, predict_course
from gravcomp.calibration.measured import Measured
from gravcomp.config import ConfigError
from gravcomp.evaluation.metrics import angle_between, inclination_deg
from gravcomp.evaluation.recorded.falls import FALLEN, PAID_OUT, WITHIN, as_measured, falls
from gravcomp.evaluation.recorded.run import RecordedRun
from gravcomp.full_model.modes import first_period
from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table

_REST = 3.6  # first periods at the end of a fall that count as rest


def run(recorded: RecordedRun) -> Result:
    """Return the evaluation. Raises ConfigError when no fall is found."""
    course, robot = recorded.course, recorded.setup.robot
    period = first_period(robot)
    measured = [as_measured(course.rows(rows), str(recorded.bag), robot) for rows in falls(course, robot, period)]
    if not measured:
        raise ConfigError(
            f"{recorded.bag}: contains no fall. A fall: cables paid out (~/relax) for {PAID_OUT * period:.2g} s, the tip held"
            f" within {1e3 * STRAIGHT * robot.length:g} mm of its place at rest, let go, and {1e3 * FALLEN * robot.length:g} mm"
            f" away from there within {WITHIN * period:.2g} s"
        )
    models = [predict_course(robot, fall) for fall in measured]
    position = [np.linalg.norm(tip - fall.tip_position, axis=1) for fall, (tip, _) in zip(measured, models)]
    direction = [_angles(towards, fall) for fall, (_, towards) in zip(measured, models)]
    rests = [fall.time >= fall.time[-1] - _REST * period for fall in measured]

    def worst(errors: list[np.ndarray], at_rest: bool) -> float:
        return max(float(e[rest].max() if at_rest else e.max()) for e, rest in zip(errors, rests))

    inclinations = [inclination_deg(fall.gravity[0]) for fall in measured]
    return Result(
        name="real2sim",
        title="Real to simulation: free fall, recorded",
        question=f"Does the model fall, swing and come to rest as the {recorded.who} does?",
        ground=recorded.ground + " The model in motion is that of the robot file: calibrate it first.",
        figures=[
            Figure("worst position error over the whole fall", 1e3 * worst(position, False), "mm", "4.7 mm", 2.0),
            Figure(
                "worst direction error over the whole fall", float(np.degrees(worst(direction, False))), "deg", "5.2 deg", 2.0
            ),
            Figure("worst position error at rest", 1e3 * worst(position, True), "mm", "4.7 mm", 2.0),
            Figure("worst direction error at rest", float(np.degrees(worst(direction, True))), "deg", "5.2 deg", 2.0),
        ],
        parts=[
            Plot(
                "Distance of the tip from its place at rest",
                _drawing(inclinations, measured, models),
                f"Vermilion: the {recorded.who}; blue: the model.",
            ),
            Table(
                "Errors by fall",
                ("inclination of the base", "worst, mm", "at rest, mm", "worst, deg", "at rest, deg"),
                [
                    (
                        f"{i:.0f}°",
                        1e3 * p.max(),
                        1e3 * p[rest].max(),
                        float(np.degrees(d.max())),
                        float(np.degrees(d[rest].max())),
                    )
                    for i, p, d, rest in zip(inclinations, position, direction, rests)
                ],
                f"At rest: the last {_REST * period:.2g} s.",
            ),
        ],
        parameters={"bag": str(recorded.bag), "falls": len(measured)},
    )


def _angles(direction: np.ndarray, fall: Measured) -> np.ndarray:
    """Return the angles (t,) in rad between the modelled directions (t, 3) and the measured ones."""
    assert fall.tip_direction is not None  # `as_measured` sets it
    return angle_between(direction, fall.tip_direction)


def _drawing(inclinations: list[float], falls: list[Measured], models: list[tuple[np.ndarray, np.ndarray]]) -> str:
    with Drawing(1, len(falls), width=max(4.0, min(11.5, 3.0 * len(falls))), height=3.0, squeeze=False, sharey=True) as drawing:
        for axes, inclination, fall, (tip, _) in zip(drawing.axes[0], inclinations, falls, models):
            for points, colour, label in ((fall.tip_position, REAL, "measured"), (tip, MODEL, "model")):
                axes.plot(fall.time, 1e3 * np.hypot(points[:, 0], points[:, 1]), color=colour, label=label, linewidth=1.2)
            axes.set_title(f"{inclination:.0f}°")
            axes.set_xlabel("time in s")
        drawing.axes[0, 0].set_ylabel("distance of the tip from the axis in mm")
        drawing.axes[0, 0].legend()
    return drawing.svg
