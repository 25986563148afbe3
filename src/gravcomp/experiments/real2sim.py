"""Free fall from the shape at rest at the article's five inclinations: the tip over time, model against virtual robot."""

from collections.abc import Callable

import numpy as np

from gravcomp.calibration.course import predict_course, predict_shapes
from gravcomp.calibration.measured import Measured
from gravcomp.calibration.motion import EVALUATIONS, fit_motion
from gravcomp.closed_loop.setup import Setup
from gravcomp.description import Robot
from gravcomp.evaluation.metrics import angle_between
from gravcomp.mesh.robot_axis import rest_axis, rest_tip
from gravcomp.report.drawing import MODEL, REAL, REST, Drawing, draw_robot, equal_axes, side_view
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.context import Context
from gravcomp.trials.free_fall import BRIEF_EVALUATIONS, SAMPLE, falling_rod, free_fall, true_fall
from gravcomp.trials.turning_base import INCLINATIONS
from gravcomp.virtual.motion import base_orientation

TITLE = "Real to simulation: free fall"

_FITTED_POSES = ((20.0, 45.0), (-25.0, -30.0))  # inclination, roll, deg: other poses than the evaluated ones
# In first periods of the robot: a fall, and when shapes are drawn.
_DURATION, _BRIEF_DURATION = 14.0, 1.5
_SHOWN = (0.1, 0.2, 0.35, 7.0)
_REST = 0.25  # of a fall: its last part, which counts as rest
# Of the sag of the horizontal robot, its tip's distance from where it is at rest, and of the turn of that tip.
_WORST, _WORST_TURN = 0.067, 0.08


def run(context: Context) -> Result:
    """Run the experiment."""
    setup = context.setup
    period = setup.first_period
    duration = SAMPLE * round((_BRIEF_DURATION if context.brief else _DURATION) * period / SAMPLE)
    inclinations = INCLINATIONS[3:4] if context.brief else INCLINATIONS
    shown = tuple(t * period for t in _SHOWN if t * period < duration)
    poses = [(i, 0.0) for i in inclinations] + list(_FITTED_POSES[: 1 if context.brief else 2])
    jobs = [(setup, i, roll, duration, trial) for trial, (i, roll) in enumerate(poses)]
    # A fit has what a tracker sees; its noise is no error of the model, which the true tip shows.
    evaluated = context.map(true_fall, jobs[: len(inclinations)], "free fall of the virtual robot")
    fit = fit_motion(
        setup.robot,
        context.map(free_fall, jobs[len(inclinations) :], "free fall to fit the model to"),
        mapper=context.sweep.map,
        progress=lambda stage: context.progress(f"fitting the fall: {stage}"),
        evaluations=BRIEF_EVALUATIONS if context.brief else EVALUATIONS,
    )
    robots = {"not calibrated": setup.robot, "calibrated": fit.robot}
    falls_of_models = [(robot, course) for robot in robots.values() for course in evaluated]
    predicted = context.map(_predict, falls_of_models, "fall of the model")
    courses = {name: predicted[k * len(evaluated) : (k + 1) * len(evaluated)] for k, name in enumerate(robots)}
    errors = {name: [_errors(course, *model) for course, model in zip(evaluated, models)] for name, models in courses.items()}
    rest = slice(-max(2, round(_REST * duration / SAMPLE)), None)
    hanging = evaluated[inclinations.index(0.0)]
    hanging = hanging.rows(np.arange(len(hanging.time))[rest])
    sag, turn = (float(part.max()) for part in _errors(hanging, *rest_tip(setup.nominal)))
    whole = slice(None)

    def worst(model: str, row: int, part: slice) -> float:
        return max(float(pair[row][part].max()) for pair in errors[model])

    return Result(
        name="real2sim",
        title=TITLE,
        question="Does the model fall, swing and come to rest like the robot?",
        ground="The dynamic model (finite elements, generalized-alpha, damping and one creep branch), in the core, against the"
        " virtual robot: a rod with three creep branches and a hysteresis that the model does not have. Gravity is estimated"
        " by the orientation filter from the virtual IMU.",
        figures=[
            *_judged(worst, "over the whole fall", whole, sag, turn),
            *_judged(worst, "at rest", rest, sag, turn),
            Figure("worst position error over the whole fall, of the sag", 100.0 * worst("calibrated", 0, whole) / sag, "%"),
            Figure("worst position error at rest, of the sag", 100.0 * worst("calibrated", 0, rest) / sag, "%"),
            Figure("mean position error over the whole fall", 1e3 * np.mean([p.mean() for p, _ in errors["calibrated"]]), "mm"),
            Figure("worst position error at rest, not calibrated", 1e3 * worst("not calibrated", 0, rest), "mm"),
            Figure("worst position error over the whole fall, not calibrated", 1e3 * worst("not calibrated", 0, whole), "mm"),
        ],
        parts=[
            Plot(
                "Tip over time",
                _courses(inclinations, evaluated, courses["calibrated"]),
                "Above: lateral tip position in the vertical plane; vermilion: virtual robot, blue: calibrated model. Below:"
                " distance and angle between the two.",
            ),
            Plot(
                "Shapes",
                _shapes(
                    [
                        (i, _fall_shapes(setup, fit.robot, i, fall, shown))
                        for i, fall in zip(inclinations, evaluated)
                        if i != 90.0
                    ],
                    setup.robot,
                ),
                f"Side view, gravity downwards, {', '.join(f'{1e3 * t:.0f}' for t in shown)} ms after the start of the fall."
                " Grey: rest shape without gravity, vermilion: virtual robot, blue: axis of the calibrated model.",
            ),
            Table(
                "Errors by pose",
                ("inclination", "model", "worst, mm", "at rest, mm", "worst, deg", "at rest, deg"),
                [
                    (
                        f"{i:g}°",
                        name,
                        1e3 * p.max(),
                        1e3 * p[rest].max(),
                        float(np.degrees(d.max())),
                        float(np.degrees(d[rest].max())),
                    )
                    for name in robots
                    for i, (p, d) in zip(inclinations, errors[name])
                ],
            ),
        ],
        parameters={
            "long-term modulus": f"{fit.youngs_modulus * 1e-6:.4f} ± {fit.modulus_interval * 1e-6:.4f} MPa",
            "damping time": f"{1e3 * fit.damping_time:.2f} ± {1e3 * fit.damping_interval:.2f} ms",
            "creep": f"{fit.creep_ratio:.4f} ± {fit.creep_ratio_interval:.4f} of the modulus within"
            f" {fit.creep_time:.3f} ± {fit.creep_time_interval:.3f} s",
            "virtual robot": setup.true_robot.materials_in_words(),
            "duration_s": duration,
        },
        notes=[
            "One model for the fall and for the rest after it, fitted at other poses than the evaluated ones: inclination and"
            f" roll {', '.join(f'{i:g}° and {r:g}°' for i, r in poses[len(inclinations) :])}.",
            f"The last {100 * _REST:.0f} % of a fall count as rest. At 90° the robot points up and does not move; 135° and 45°"
            " are mirror images.",
            "A material with creep is stiffer during the swing than at rest: a model with one modulus and damping alone has an"
            " error either in the frequency of the swing or at rest.",
        ],
    )


def _judged(worst: Callable[[str, int, slice], float], when: str, part: slice, sag: float, turn: float) -> list[Figure]:
    """Return the worst errors of the calibrated model, with limits in shares of the sag (m) and of the tip's turn (rad)."""
    position, direction = 1e3 * worst("calibrated", 0, part), np.degrees(worst("calibrated", 1, part))
    return [
        Figure(f"worst position error {when}", position, "mm", "4.7 mm", 1e3 * _WORST * sag),
        Figure(f"worst direction error {when}", direction, "deg", "5.2 deg", float(np.degrees(_WORST_TURN * turn))),
    ]


def _predict(job: tuple[Robot, Measured]) -> tuple[np.ndarray, np.ndarray]:
    return predict_course(*job)


def _errors(course: Measured, tip: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances (t,) m and the angles (t,) rad between a model's tips and the measured ones."""
    assert course.tip_direction is not None
    return np.linalg.norm(tip - course.tip_position, axis=1), angle_between(direction, course.tip_direction)


def _fall_shapes(
    setup: Setup, robot: Robot, inclination: float, fall: Measured, times: tuple[float, ...]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return backbones (n, 3) of the virtual robot and of the model `robot`, in the world, at `times` (s)."""
    base = base_orientation(np.radians(inclination))
    samples = [max(1, round(t / SAMPLE)) for t in times]
    course = fall.rows(np.arange(samples[-1] + 1))
    modelled = dict(enumerate(predict_shapes(robot, course)))
    true = dict(enumerate(falling_rod(setup, base, times[-1])))
    found = []
    for k in samples:
        shape = modelled[k]
        assert shape is not None  # only the shape at rest at the start has none
        found.append((true[k][0], shape.backbone_position @ base.T))
    return found


def _shapes(falls: list[tuple[float, list]], robot: Robot) -> str:
    rest, _ = rest_axis(robot).frames(robot.length * np.linspace(0.0, 1.0, 33))
    with Drawing(1, len(falls), width=11.5, height=3.4, squeeze=False) as drawing:
        for axes, (inclination, shapes) in zip(drawing.axes[0], falls):
            draw_robot(axes, side_view(rest, base_orientation(np.radians(inclination))), REST, "rest shape", alpha=0.6)
            for k, (true, modelled) in enumerate(shapes):
                draw_robot(
                    axes, true[:, [0, 2]], REAL, "virtual robot" if k == 0 else None, alpha=0.45 + 0.55 * (k + 1) / len(shapes)
                )
                axes.plot(
                    *(1e3 * modelled[:, [0, 2]].T), color=MODEL, linewidth=1.2, linestyle="--", label="model" if k == 0 else None
                )
            axes.set_title(f"{inclination:g}°")
            equal_axes(axes)
        drawing.axes[0, 0].legend(loc="lower left")
    return drawing.svg


def _courses(inclinations: tuple, falls: list[Measured], models: list) -> str:
    with Drawing(2, len(falls), width=11.5, height=5.0, squeeze=False, sharex=True) as drawing:
        for column, (inclination, fall, (tip, direction)) in enumerate(zip(inclinations, falls, models)):
            above, below = drawing.axes[:, column]
            above.plot(fall.time, 1e3 * fall.tip_position[:, 0], color=REAL, label="virtual robot")
            above.plot(fall.time, 1e3 * tip[:, 0], color=MODEL, linewidth=1.1, label="model")
            above.set_title(f"{inclination:g}°")
            position, angle = _errors(fall, tip, direction)
            below.plot(fall.time, 1e3 * position, color="#37404a", label="mm")
            below.plot(fall.time, np.degrees(angle), color="#e69f00", label="deg")
            below.set_xlabel("time in s")
        drawing.axes[0, 0].set_ylabel("lateral tip position in mm")
        drawing.axes[1, 0].set_ylabel("error")
        drawing.axes[0, 0].legend()
        drawing.axes[1, 0].legend()
    return drawing.svg
