"""An arm turns the base through the article's five inclinations and back: two passes of 90 s, straight and bent."""

import numpy as np
from scipy.spatial.transform import Rotation

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.evaluation import metrics
from gravcomp.inverse.target import arc_points
from gravcomp.report.drawing import REAL, REST, TARGET, WITHOUT, Drawing, draw_robot, equal_axes, side_view
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.calibration_run import calibrate_on_virtual_robot
from gravcomp.trials.context import Context
from gravcomp.trials.holding import GROUND, Case, errors_to, held_notes, lasting, target_of
from gravcomp.trials.turning_base import INCLINATIONS
from gravcomp.virtual.motion import WaypointMotion, base_orientation, quaternion

TITLE = "On a moving arm"

HOLD, RATE = 10.0, np.radians(4.5)  # s, rad/s: a pass of 90 s; slow robots are held longer
ARTICLE = {0.0: "0.9653 without, 0.9830 with", 30.0: "0.9394 without, 0.9439 with"}
_START = 4.0  # s at the first pose before the passes, in which the robot comes to rest
_BRIEF_START, _BRIEF_HOLD, _BRIEF_FASTER = 1.0, 0.3, 30.0  # s, s, times the rate
_BRIEF_INCLINATIONS = (45.0, 0.0)
_PERIODS = 13.0  # first periods of the robot that either lasts at least


def run(context: Context) -> Result:
    """Run the experiment."""
    inclinations = _BRIEF_INCLINATIONS if context.brief else INCLINATIONS
    setups = {"calibrated": context.once(calibrate_on_virtual_robot).setup, "not calibrated": context.setup}
    jobs = [
        (setup, bend, weightless, context.brief)
        for bend in (0.0, 30.0)
        for setup, weightless in ((context.setup, True), *((setup, False) for setup in setups.values()))
    ]
    traces = context.map(_pass, jobs, "two passes")
    figures, rows, plots, notes = [], [], [], []
    for index, bend in enumerate((0.0, 30.0)):
        without, fitted, plain = traces[3 * index : 3 * index + 3]
        target = target_of(context.setup, Case(0.0, bend=bend))
        evaluated = {
            name: (_recovery(trace, target.tip_position), errors_to(trace, target))
            for name, trace in (("without", without), ("calibrated", fitted), ("not calibrated", plain))
        }
        shape = f"bent by {bend:g} deg" if bend else "straight"
        left = evaluated["calibrated"][1].lateral.mean() / evaluated["without"][1].lateral.mean()
        gain = evaluated["without"][1].distance.mean() / evaluated["calibrated"][1].distance.mean()
        figures += [
            Figure(f"recovery rate r, {shape}, calibrated", evaluated["calibrated"][0], "", ARTICLE[bend], 0.99, True, 5),
            Figure(f"recovery rate r, {shape}, without compensation", evaluated["without"][0], "", digits=5),
            Figure(f"tip error ratio, without / with compensation, {shape}", gain, "", limit=5.0, at_least=True),
            Figure(f"mean lateral error, {shape}, calibrated, of that without compensation", 100.0 * left, "%"),
        ]
        if not bend:
            notes = held_notes(context.setup, *(evaluated[name][1].lateral.mean() for name in ("calibrated", "without")))
        for name, (r, errors) in evaluated.items():
            mean = [1e3 * errors.distance.mean(), 1e3 * errors.distance.max(), 1e3 * errors.lateral.mean()]
            rows.append((shape, name, f"{r:.5f}", *mean, float(np.degrees(errors.tilt.mean()))))
        plots.append(
            Plot(
                f"{shape.capitalize()}: at the five poses",
                _shapes(
                    inclinations,
                    without,
                    fitted,
                    arc_points(context.setup.robot.length, np.radians(bend), 0.0, context.setup.robot.effectors.backbone_station),
                ),
                "Side view, gravity downwards, at the end of each stop of the first pass. Grey: target shape. Pink: without"
                " compensation. Vermilion: compensated, calibrated.",
            )
        )
        plots.append(
            Plot(
                f"{shape.capitalize()}: tip over time",
                _course(without, fitted, target.tip_position),
                "Left: height of the tip over the base, in the world, and height of the target. Right: distance of the tip"
                " from its target.",
            )
        )
    return Result(
        name="arm",
        title=TITLE,
        question="Does the robot keep its shape while its base turns from pointing up to pointing down?",
        ground=GROUND + " The virtual arm turns the base about a horizontal axis; it does not translate it.",
        figures=figures,
        parts=[
            Table(
                "All runs",
                ("shape", "compensation", "r", "mean tip error, mm", "largest, mm", "mean lateral, mm", "mean tilt, deg"),
                rows,
                "r: correlation of target tip and true tip, both in world axes relative to the base, over both passes.",
            ),
            *plots,
        ],
        parameters={
            "inclinations_deg": inclinations,
            "hold_s": lasting(context.setup, HOLD, _PERIODS),
            "rate_deg_s": float(np.degrees(RATE)),
            "passes": 2,
        },
        notes=[
            "Without compensation: straight means released cables; bent means that the cables that bend the weightless robot"
            " keep their displacement and the others are released.",
            "With the base tilted back (135 deg) the uncompensated robot falls over to the other side; this dominates r.",
            *notes,
        ],
    )


def _pass(job: tuple[Setup, float, bool, bool]) -> Trace:
    setup, bend, weightless, brief = job
    inclinations = _BRIEF_INCLINATIONS if brief else (*INCLINATIONS, *INCLINATIONS[-2::-1])
    start, hold = (_BRIEF_START, _BRIEF_HOLD) if brief else (lasting(setup, _START, _PERIODS), lasting(setup, HOLD, _PERIODS))
    stops = [(base_orientation(np.radians(i)), hold + (start if k == 0 else 0.0)) for k, i in enumerate(inclinations)]
    motion = WaypointMotion(stops, RATE * (_BRIEF_FASTER if brief else 1.0))
    loop = ClosedLoop(setup, motion)
    loop.hold(target_of(setup, Case(0.0, bend=bend)), weightless=weightless)
    loop.run(start)
    loop.forget()
    loop.run(motion.duration - loop.time)
    return loop.trace


def _recovery(trace: Trace, target: np.ndarray) -> float:
    """Return the recovery rate r between target tip and true tip, in world axes relative to the base."""
    wanted = Rotation.from_quat(trace.base_orientation).apply(target)
    return metrics.recovery_rate(wanted, Rotation.from_quat(trace.base_orientation).apply(trace.tip_position))


def _shapes(inclinations: tuple[float, ...], without: Trace, fitted: Trace, wanted: np.ndarray) -> str:
    """Draw the shapes at the poses. wanted: backbone (b, 3) of the target shape, in soft_base."""
    with Drawing(1, len(inclinations), width=11.5, height=2.9) as drawing:
        for axes, inclination in zip(drawing.axes, inclinations):
            base = base_orientation(np.radians(inclination))
            draw_robot(axes, side_view(wanted, base), REST, "target")
            for trace, colour, label in ((without, WITHOUT, "without"), (fitted, REAL, "compensated")):
                draw_robot(axes, side_view(trace.backbone[_end_of_stop(trace, base)], base), colour, label)
            axes.set_title(f"{inclination:g}°")
            equal_axes(axes)
        drawing.axes[0].legend(loc="lower left")
    return drawing.svg


def _end_of_stop(trace: Trace, base: np.ndarray) -> int:
    """Return the index of the last sample of the first stop at the orientation `base` (3, 3)."""
    q = np.moveaxis(trace.base_orientation, -1, 0)
    turned = 2.0 * np.arccos(np.clip(np.abs(quaternion(base) @ q), 0.0, 1.0))
    there = turned < np.radians(0.5)
    first = int(np.argmax(there))
    left = np.flatnonzero(~there[first:])
    return first + int(left[0]) - 1 if len(left) else len(there) - 1


def _course(without: Trace, fitted: Trace, target: np.ndarray) -> str:
    with Drawing(1, 2, width=10.5, height=3.2) as drawing:
        height, error = drawing.axes
        wanted = Rotation.from_quat(fitted.base_orientation).apply(target)
        height.plot(fitted.time, 1e3 * wanted[:, 2], color=TARGET, label="target", linewidth=2.4, alpha=0.6)
        for trace, colour, label in ((without, WITHOUT, "without"), (fitted, REAL, "compensated, calibrated")):
            tip = Rotation.from_quat(trace.base_orientation).apply(trace.tip_position)
            height.plot(trace.time, 1e3 * tip[:, 2], color=colour, label=label, linewidth=1.2)
            error.plot(trace.time, 1e3 * np.linalg.norm(trace.tip_position - target, axis=1), color=colour, label=label)
        height.set_ylabel("height of the tip in mm")
        error.set_ylabel("tip error in mm")
        for axes in drawing.axes:
            axes.set_xlabel("time in s")
        height.legend(loc="best")
    return drawing.svg
