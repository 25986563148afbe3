"""Yaw over nine minutes with and without the orientation filter and the heating, at rest and turning at 23 deg/s."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gravcomp.report.drawing import MODEL, REAL, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.thermal import HeaterOptions, ThermalPlantOptions
from gravcomp.trials.context import Context
from gravcomp.trials.yaw_drift import COLD, DURATION, RATE, REST, ROOM, BoardSample, board_samples, turning_after, yaw_errors
from gravcomp.virtual.imu_chip import SAMPLE_PERIOD
from gravcomp.virtual.parameters import Board

TITLE = "IMU: filter and heating"

_BRIEF_DURATION, _BRIEF_REST = 4.0, 3.0  # s
_WINDOW = 30.0  # s, over which the article reports 20 deg
_MOTIONS = (("at rest", 0.0), ("turning at 23 deg/s", RATE))
_FILTERS = (("filter", "with filter"), ("no_filter", "raw rate integrated"))


def run(context: Context) -> Result:
    """Run the experiment."""
    duration, rest = (_BRIEF_DURATION, _BRIEF_REST) if context.brief else (DURATION, REST)
    jobs = [
        (context.setup.true_robot.board, rate, heated, duration, rest, context.setup.seed)
        for _, rate in _MOTIONS
        for heated in (True, False)
    ]
    courses = context.map(_drift, jobs, "nine minutes of IMU samples")
    runs = [(motion, heated) for motion, _ in _MOTIONS for heated in (True, False)]
    figures, rows = [], []
    for (motion, heated), course in zip(runs, courses):
        for key, label in _FILTERS:
            yaw = course[key]
            heating = "heated" if heated else "not heated"
            rows.append(
                (motion, label, heating, float(np.abs(yaw).max()), _within(yaw, _WINDOW), float(course["temperature"].std()))
            )
            if key == "filter" or not heated:
                article = "drifts by about 20 deg in 30 s" if (key, heated, motion) == ("no_filter", False, "at rest") else ""
                limit = 1.0 if (key, heated, motion) == ("filter", True, "at rest") else None
                figures.append(
                    Figure(f"yaw drift, {motion}, {label}, {heating}", float(np.abs(yaw).max()), "deg", article, limit)
                )
    return Result(
        name="imu-ablation",
        title=TITLE,
        question="How much do the orientation filter and the heating each reduce the drift of the orientation?",
        ground="The virtual board alone (BMI088 noise, bias, temperature coefficient, quantisation, heater and chip), read"
        f" through its CAN frames, in the core faster than real time. Stored at {COLD:g} degC, in a room of {ROOM:g} degC; yaw"
        f" against the ground truth after {rest:g} s at rest.",
        figures=figures,
        parts=[
            Plot(
                "Yaw drift over nine minutes",
                _panels(runs, courses),
                "The scales differ: the curves of the filter would be a line in the other panels.",
            ),
            Table(
                "All eight pipelines",
                (
                    "motion",
                    "orientation",
                    "heating",
                    "largest drift, deg",
                    "largest within 30 s, deg",
                    "temperature, standard deviation, degC",
                ),
                rows,
                "Only yaw: it is not observable from gravity, so it shows the bias of the gyroscope directly. Compensation"
                " needs only the direction of gravity, which the accelerometer observes.",
            ),
        ],
        parameters={
            "duration_s": duration,
            "rest_s": rest,
            "rate_deg_s": float(np.degrees(RATE)),
            "board": repr(context.setup.true_robot.board),
        },
    )


def _drift(job: tuple[Board, float, bool, float, float, int]) -> dict[str, np.ndarray]:
    """Return yaw drift in deg and temperature in degC, one row per second."""
    board, rate, heated, duration, rest, seed = job
    board = replace(board, thermal=ThermalPlantOptions(ambient=ROOM, start=COLD))
    temperatures: list[float] = []

    def samples() -> Iterator[BoardSample]:
        heater = HeaterOptions() if heated else None
        for sample in board_samples(board, heater, rest + duration, turning_after(rest, rate), seed):
            temperatures.append(sample.true_temperature)
            yield sample

    errors = yaw_errors(samples(), rate, rest)
    every = round(1.0 / SAMPLE_PERIOD)
    drift = {}
    for name, error in errors.items():
        yaw = np.degrees(np.unwrap(error))
        drift[name] = (yaw - yaw[0])[::every]
    drift["temperature"] = np.array(temperatures)[round(rest / SAMPLE_PERIOD) :: every]
    return drift


def _within(yaw: np.ndarray, window: float) -> float:
    step = min(round(window), len(yaw) - 1)
    return float(np.abs(yaw[step:] - yaw[:-step]).max())


def _panels(runs: list[tuple[str, bool]], courses: list[dict]) -> str:
    with Drawing(2, 2, width=10.5, height=5.6, sharex=True) as drawing:
        for row, (key, label) in enumerate(_FILTERS):
            for column, (motion, _) in enumerate(_MOTIONS):
                axes = drawing.axes[row, column]
                for (name, heated), course in zip(runs, courses):
                    if name == motion:
                        colour, text = (REAL, "heated") if heated else (MODEL, "not heated")
                        axes.plot(np.arange(len(course[key])) / 60.0, course[key], color=colour, label=text)
                axes.set_title(f"{label}, {motion}")
                axes.set_ylabel("yaw drift in deg")
        for axes in drawing.axes[1]:
            axes.set_xlabel("time in min")
        drawing.axes[0, 0].legend()
    return drawing.svg
