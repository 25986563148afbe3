"""Latency of the response to gravity: that of the running graph, its cost while the base moves, the effect of prediction."""

import dataclasses
import math
import time

import numpy as np

from gravcomp.closed_loop.loop import SAMPLE_PERIOD, ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.launcher import LaunchError, NodeDied
from gravcomp.report.drawing import MODEL, REAL, WITHOUT, Drawing
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.calibration_run import calibrate_on_virtual_robot
from gravcomp.trials.context import Context
from gravcomp.trials.holding import Case, errors_to, lasting, target_of
from gravcomp.virtual.motion import SyntheticMotion, base_orientation, turned

TITLE = "Latency, and prediction of gravity"

DELAYS = (0, 1, 3, 10, 30, 300)  # samples of 10 ms; the last is the article's
_BRIEF_DELAYS = (0, 10)
_START, _DURATION = 3.0, 12.0  # s, at least, before the base swings; s, two of its periods
_BRIEF_START, _BRIEF_DURATION = 1.5, 1.0  # s
_PERIODS = 11.0  # first periods of the robot that the start lasts at least
_WARM_UP, _LISTEN = 5.0, 15.0  # s
_BRIEF_WARM_UP, _BRIEF_LISTEN = 0.5, 1.5  # s
_LONGEST_HORIZON = 0.5  # s, limit of the estimator


class SwingingMotion(SyntheticMotion):
    """The base swings about a horizontal axis by +- amplitude (rad) with the period (s), after `hold` s at rest."""

    def __init__(self, amplitude: float, period: float, hold: float):
        self._amplitude, self._period, self._hold = amplitude, period, hold

    @property
    def fastest(self) -> float:
        """Largest rate, rad/s."""
        return 2 * math.pi / self._period * self._amplitude

    def pose(self, moment: float) -> tuple[np.ndarray, np.ndarray]:
        """Return orientation (3, 3) and position (3,) m of the base in the world at a time in s."""
        since = max(0.0, moment - self._hold)
        # 1 - cos rather than sin: it starts with zero rate.
        angle = self._amplitude * (1.0 - math.cos(2 * math.pi * since / self._period))
        return base_orientation(0.0) @ turned(np.array([0.0, angle, 0.0])), np.zeros(3)


def run(context: Context) -> Result:
    """Run the experiment."""
    measured, failure = _graph_delays(context)
    setup = context.once(calibrate_on_virtual_robot).setup
    delays = _BRIEF_DELAYS if context.brief else DELAYS
    jobs = [(setup, delay, predicted, context.brief) for delay in delays for predicted in ((False, True) if delay else (False,))]
    runs = dict(zip([job[1:3] for job in jobs], context.map(_swing, jobs, "swinging base")))
    errors = {case: _rms(runs[case].error, case[0]) for case in runs}
    moved = {case: _rms(np.linalg.norm(runs[case].tip - runs[0, False].tip, axis=1), case[0]) for case in runs if case[0]}
    in_ms = 1e3 * np.array(measured)
    median = float(np.median(in_ms)) if len(in_ms) else math.nan
    p99 = float(np.percentile(in_ms, 99)) if len(in_ms) else math.nan
    pair = (10, False), (10, True)
    figures = [
        Figure("latency from IMU sample to motor current, median", median, "ms", "about 3 s", 100.0),
        Figure("latency from IMU sample to motor current, 99th percentile", p99, "ms", "about 3 s", 100.0),
    ]
    if pair[0] in runs:
        figures += [
            Figure("tip displacement caused by a delay of 100 ms, without prediction", 1e3 * moved[pair[0]], "mm"),
            Figure("tip displacement caused by a delay of 100 ms, with prediction", 1e3 * moved[pair[1]], "mm"),
        ]
    if (300, False) in runs:
        figures.append(Figure("tip displacement caused by the article's delay of 3 s", 1e3 * moved[300, False], "mm"))
    swing = SwingingMotion(np.radians(20.0), 6.0, 0.0)
    return Result(
        name="delay",
        title=TITLE,
        question="How late do the cables respond to a rotation of the base, and how much of the error does prediction remove?",
        ground=(
            "The latency is that of the running graph, four nodes and the virtual robot as processes on this machine, measured"
            " on the CAN bus: from the last frame of an IMU sample to the first current frame that it caused."
            if not failure
            else f"The running graph could not be measured here: {failure}."
        )
        + " The cost of a delay is computed in the core, faster than real time, against the virtual robot, with a delay between"
        " loop and bridge.",
        figures=figures,
        parts=[
            Plot(
                "Latency",
                _drawing(in_ms, moved),
                "Left: latencies in the running graph. Right: tip displacement caused by a delay while the base swings,"
                " without prediction and with gravity predicted ahead by the delay.",
            ),
            Table(
                "Tip error on a swinging base",
                (
                    "delay, ms",
                    "tip error, mm RMS",
                    "caused by the delay, mm RMS",
                    "tip error predicted, mm RMS",
                    "caused, mm RMS",
                ),
                [
                    (
                        10 * delay,
                        1e3 * errors[delay, False],
                        1e3 * moved[delay, False],
                        1e3 * errors[delay, True],
                        1e3 * moved[delay, True],
                    )
                    if delay
                    else (0, 1e3 * errors[0, False], "–", "–", "–")
                    for delay in delays
                ],
                f"The base swings by ±20 deg every 6 s, at most {np.degrees(swing.fastest):.0f} deg/s. Tip error: distance of"
                " the tip from that of the straight robot. Caused by the delay: distance of the tip from that of the run"
                f" without delay at the same time. Gravity is predicted by at most {1e3 * _LONGEST_HORIZON:.0f} ms.",
            ),
        ],
        parameters={
            "delays_ms": [10 * d for d in delays],
            "swing_deg": 20.0,
            "period_s": 6.0,
            "samples in the graph": len(in_ms),
        },
        data={"graph_delay_ms": {"median": median, "p99": p99, "samples": len(in_ms)}},
    )


def _graph_delays(context: Context) -> tuple[list[float], str]:
    """Return the latencies of the running graph in s, or none and the reason."""
    from gravcomp.evaluation.bus_delay import DelayListener
    from gravcomp.launcher.virtual_graph import RunningGraph

    warm_up, listen = (_BRIEF_WARM_UP, _BRIEF_LISTEN) if context.brief else (_WARM_UP, _LISTEN)
    context.progress("starting the running graph")
    try:
        with RunningGraph() as graph:
            graph.wait_for_commands()
            context.progress(f"latency of the running graph over {warm_up + listen:.0f} s")
            time.sleep(warm_up)
            listener = DelayListener(graph.can)
            listener.start()
            time.sleep(listen)
            listener.stop()
            graph.check()
    except (LaunchError, NodeDied, TimeoutError, ImportError, OSError) as error:
        return [], str(error).rstrip(".")
    return listener.delays, "" if listener.delays else listener.failure or "no command was traced on the bus"


@dataclasses.dataclass(frozen=True)
class _Run:
    """Tip position (t, 3) m and its distance (t,) m from the target, from the time at which the base begins to swing."""

    tip: np.ndarray
    error: np.ndarray


def _swing(job: tuple[Setup, int, bool, bool]) -> _Run:
    """Run one case. job: (setup, delay in samples, whether gravity is predicted, whether the run is brief)."""
    setup, delay, predicted, brief = job
    start, duration = (_BRIEF_START, _BRIEF_DURATION) if brief else (lasting(setup, _START, _PERIODS), _DURATION)
    if predicted:
        horizon = min(delay * SAMPLE_PERIOD, _LONGEST_HORIZON)
        prediction = dataclasses.replace(setup.estimator.prediction, horizon=horizon)
        setup = dataclasses.replace(setup, estimator=dataclasses.replace(setup.estimator, prediction=prediction))
    loop = ClosedLoop(setup, SwingingMotion(np.radians(20.0), 6.0, start), delay=delay)
    target = target_of(setup, Case(0.0))
    loop.hold(target)
    loop.run(start)
    loop.forget()
    loop.run(duration)
    trace = loop.trace
    return _Run(trace.tip_position, errors_to(trace, target).distance)


def _rms(values: np.ndarray, delay: int) -> float:
    """Return the RMS of samples (t,) without the first `delay` ones, which precede the first command of the swinging base."""
    return float(np.sqrt((values[delay:] ** 2).mean()))


def _drawing(in_ms: np.ndarray, moved: dict) -> str:
    with Drawing(1, 2, width=10.5, height=3.3) as drawing:
        histogram, cost = drawing.axes
        if len(in_ms):
            histogram.hist(in_ms, bins=40, range=(0.0, max(20.0, float(np.percentile(in_ms, 99.5)))), color=MODEL, alpha=0.85)
            histogram.axvline(float(np.median(in_ms)), color=REAL, label=f"median {np.median(in_ms):.1f} ms")
            histogram.legend()
        histogram.set_xlabel("from IMU sample to current in ms")
        histogram.set_ylabel("samples")
        for predicted, colour, label in ((False, WITHOUT, "without prediction"), (True, REAL, "gravity predicted")):
            points = sorted((10 * d, 1e3 * moved[d, p]) for d, p in moved if p is predicted)
            cost.plot(*zip(*points), "o-", color=colour, label=label)
        cost.set_xscale("log")
        cost.set_yscale("symlog", linthresh=0.1)
        cost.set_xlabel("delay in ms")
        cost.set_ylabel("tip displacement in mm")
        cost.legend()
    return drawing.svg
