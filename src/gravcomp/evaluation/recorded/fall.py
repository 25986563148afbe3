"""Free falls in a recording: the robot held straight by hand, its cables paid out, and let go; against the model's fall.

When it was let go nobody measures. At first the tip moves as d = a (t - t_0)^2 / 2, so sqrt(d) of the first samples is a straight line that
begins at t_0.
"""

import numpy as np

from gravcomp.calibration.measured import Measured
from gravcomp.calibration.motion import STRAIGHT, predict_course
from gravcomp.config import ConfigError
from gravcomp.evaluation.metrics import angle_between, inclination_deg
from gravcomp.evaluation.recorded.run import RELEASED, Course, RecordedRun
from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table

_FALLEN, _WITHIN = 8e-3, 0.5  # m beside the straight robot, and s within which it gets there: a fall
_BEGINNING = (1e-3, 10e-3)  # m: of the first samples that tell when it was let go
_HELD_BY_HAND = 1.0  # s that the cables have been paid out before: a robot that they let down does not fall
_LONGEST = 4.0  # s of a fall
_SHORTEST = 1.0  # s
_REST = 1.0  # s at the end that count as rest


def run(recorded: RecordedRun) -> Result:
    """The judgement. Raises ConfigError when no fall is found."""
    course = recorded.course
    falls = [_as_measured(recorded, course.rows(rows)) for rows in _falls(course, recorded.setup.robot.length)]
    if not falls:
        raise ConfigError(
            f"{recorded.bag}: holds no fall: cables paid out (~/relax) for {_HELD_BY_HAND:g} s, the tip held within {1e3 * STRAIGHT:g} mm of straight,"
            f" let go, and {1e3 * _FALLEN:g} mm away from there within {_WITHIN:g} s"
        )
    models = [predict_course(recorded.setup.robot, fall) for fall in falls]
    position = [np.linalg.norm(tip - fall.tip_position, axis=1) for fall, (tip, _) in zip(falls, models)]
    direction = [angle_between(towards, fall.tip_direction) for fall, (_, towards) in zip(falls, models)]
    rests = [fall.time >= fall.time[-1] - _REST for fall in falls]

    def worst(errors: list[np.ndarray], at_rest: bool) -> float:
        return max(float(e[rest].max() if at_rest else e.max()) for e, rest in zip(errors, rests))

    inclinations = [inclination_deg(fall.gravity[0]) for fall in falls]
    return Result(
        name="real2sim",
        title="Real to simulation: free fall, recorded",
        question=f"Does the model fall, swing and come to rest as the {recorded.who} does?",
        ground=recorded.ground + " The model in motion is that of the robot's file: calibrate it first.",
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
                "Distance of the tip from straight",
                _drawing(inclinations, falls, models),
                f"Vermilion the {recorded.who}, blue the model.",
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
                f"At rest: the last {_REST:g} s.",
            ),
        ],
        parameters={"bag": str(recorded.bag), "falls": len(falls)},
    )


def _falls(course: Course, length: float) -> list[np.ndarray]:
    """Rows of each fall, from the last sample near straight on."""
    distance = np.linalg.norm(course.tip_position - [0.0, 0.0, length], axis=1)
    released = course.phase == RELEASED
    falls, last = [], -1
    for start in np.flatnonzero((distance[:-1] <= STRAIGHT) & (distance[1:] > STRAIGHT) & released[:-1]):
        soon = (course.time > course.time[start]) & (course.time <= course.time[start] + _WITHIN)
        before = course.time >= course.time[start] - _HELD_BY_HAND
        paid_out = (
            course.time[start] - course.time[0] >= _HELD_BY_HAND and released[before & (course.time <= course.time[start])].all()
        )
        if start <= last or not paid_out or not (distance[soon] > _FALLEN).any():
            continue
        end = int(np.searchsorted(course.time, course.time[start] + _LONGEST, side="right"))
        # It ends where the cables are pulled again, or the next one begins.
        again = np.flatnonzero(~released[start:end] | ((distance[start:end] <= STRAIGHT) & (np.arange(end - start) > 0)))
        end = start + int(again[0]) if len(again) else end
        if course.time[end - 1] - course.time[start] >= _SHORTEST:
            falls.append(np.arange(start, end))
            last = end
    return falls


def _as_measured(recorded: RecordedRun, course: Course) -> Measured:
    """From the moment at which it was let go, straight."""
    robot = recorded.setup.robot
    straight = np.array([0.0, 0.0, robot.length])
    let_go = _let_go(course.time, np.linalg.norm(course.tip_position - straight, axis=1))
    course = course.rows(course.time > let_go)
    count = len(course.time) + 1
    return Measured(
        source=str(recorded.bag),
        trial=np.zeros(count, int),
        time=np.append(let_go, course.time) - let_go,
        gravity=course.gravity[np.append(0, np.arange(count - 1))],
        displacement=np.full((count, len(robot.cables)), np.nan),
        tip_position=np.vstack([straight, course.tip_position]),
        tip_direction=np.vstack([[0.0, 0.0, 1.0], course.tip_direction]),
    )


def _let_go(time: np.ndarray, distance: np.ndarray) -> float:
    """s: where the line through sqrt(distance) of the first samples begins; the first sample where they are too few to tell."""
    low, high = _BEGINNING
    first = np.arange(np.argmax(distance >= low), np.argmax(distance > high))
    if len(first) < 2:
        return float(time[0])
    slope, offset = np.polyfit(time[first], np.sqrt(distance[first]), 1)
    return float(np.clip(-offset / slope, time[0] - 0.1, time[first[0]]))


def _drawing(inclinations: list[float], falls: list[Measured], models: list) -> str:
    with Drawing(1, len(falls), width=max(4.0, min(11.5, 3.0 * len(falls))), height=3.0, squeeze=False, sharey=True) as drawing:
        for axes, inclination, fall, (tip, _) in zip(drawing.axes[0], inclinations, falls, models):
            for points, colour, label in ((fall.tip_position, REAL, "measured"), (tip, MODEL, "model")):
                axes.plot(fall.time, 1e3 * np.hypot(points[:, 0], points[:, 1]), color=colour, label=label, linewidth=1.2)
            axes.set_title(f"{inclination:.0f}°")
            axes.set_xlabel("time in s")
        drawing.axes[0, 0].set_ylabel("tip beside the axis in mm")
        drawing.axes[0, 0].legend()
    return drawing.svg
