"""Static compensation: the robot is released at several poses, then compensated towards a straight or bent target.

The controller has nominal parameters, other than those of the virtual robot, or calibrated ones.
"""

import dataclasses

import numpy as np

from gravcomp.report.drawing import MODEL, REAL, REST, TARGET, WITHOUT, Drawing, draw_robot, equal_axes, side_view
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.calibration_run import calibrate_on_virtual_robot
from gravcomp.trials.context import Context
from gravcomp.trials.holding import GROUND, Case, Outcome, held_notes, pooled_recovery, run_cases
from gravcomp.virtual.motion import base_orientation

TITLE = "Static compensation"

CASES = (
    Case(135.0),
    Case(90.0),
    Case(45.0),
    Case(0.0),
    Case(-45.0),
    Case(0.0, roll=40.0),
    Case(0.0, bend=30.0, plane=0.0),
    Case(0.0, bend=30.0, plane=90.0),
    Case(45.0, bend=60.0, plane=180.0),
)


LARGEST = 0.035
"""Of the sag of the horizontal robot: what may remain in any pose."""


def run(context: Context) -> Result:
    """Run the experiment."""
    cases = [dataclasses.replace(case, brief=True) for case in CASES[3::3]] if context.brief else CASES
    calibrated = context.once(calibrate_on_virtual_robot)
    jobs = [(setup, case) for setup in (context.setup, calibrated.setup) for case in cases]
    outcomes = run_cases(context, jobs, "static compensation")
    plain, fitted = outcomes[: len(cases)], outcomes[len(cases) :]
    straight = [o for o in fitted if not o.case.bend]
    sag = next(o.without.lateral for o in straight if o.case.inclination == 0.0)
    largest = max(o.held.lateral for o in fitted)
    return Result(
        name="static",
        title=TITLE,
        question="How accurately does the robot keep a straight and a bent shape against gravity at rest?",
        ground=GROUND,
        figures=[
            Figure(
                "recovery rate r at rest, calibrated", pooled_recovery(fitted), "", "> 0.99", limit=0.999, at_least=True, digits=6
            ),
            Figure("recovery rate r at rest, not calibrated", pooled_recovery(plain), "", "> 0.99", digits=6),
            Figure("recovery rate r including the transition, calibrated", pooled_recovery(fitted, at_rest=False), "", digits=4),
            Figure("largest lateral error, calibrated", 1e3 * largest, "mm", limit=1e3 * LARGEST * sag),
            Figure(
                "largest lateral error, calibrated, of the horizontal sag",
                100.0 * largest / sag,
                "%",
                limit=100.0 * LARGEST,
            ),
            Figure("largest lateral error, not calibrated", 1e3 * max(o.held.lateral for o in plain), "mm"),
            Figure("largest tip error without compensation", 1e3 * max(o.without.distance for o in straight), "mm"),
            Figure("largest tilt of the tip, calibrated", np.degrees(max(o.held.tilt for o in fitted)), "deg"),
            Figure("longest settling time, calibrated", float(np.nanmax([o.converged for o in fitted])), "s", "about 6 s"),
        ],
        parts=[
            Plot(
                "Released, and compensated by the calibrated controller",
                _shapes([o for o in fitted if not o.case.roll]),
                "Side view, gravity downwards. Grey: target shape. Pink: released. Vermilion: compensated, true shape of the"
                " virtual robot. Targets that bend out of the drawn plane are projected onto it.",
            ),
            _table("Calibrated", fitted),
            _table("Not calibrated", plain),
            Plot(
                "Tip over time, horizontal, compensated from 3 s on",
                _course(*(next(o for o in group if o.case.inclination == 0.0) for group in (plain, fitted))),
                "Distance of the virtual robot's tip from its target.",
            ),
        ],
        parameters={
            "poses": [case.name for case in cases],
            "calibrated": {e.name: f"{e.value:.5g} +- {e.interval:.2g} {e.unit}" for e in calibrated.fit.estimates},
            "virtual robot": context.setup.true_robot.materials_in_words(),
            "seed": context.setup.seed,
        },
        notes=[
            "The recovery rate is the correlation of the simulated and the true tip over all poses, each of the three"
            " coordinates centred. At rest: over half a second each of the released and of the compensated robot. Including"
            " the transition: from half a second before the target is set to the end. In the transition the robot lags behind"
            " its model by the 0.1 s in which the motors wind up the released cables.",
            "Compensation shortens the robot, because cables only pull: the axial error is a property of the shape, not of the"
            " control.",
            *held_notes(context.setup, max(o.held.lateral for o in straight), sag),
            *calibrated.fit.warnings,
        ],
    )


def _table(title: str, outcomes: list[Outcome]) -> Table:
    header = (
        "pose and target", "tip error without, mm", "with, mm", "lateral, mm", "axial, mm", "tilt, deg", "mid-body without, mm",
        "with, mm", "r", "settled after, s",
    )  # fmt: skip
    rows = [
        (
            o.case.name, 1e3 * o.without.distance, 1e3 * o.held.distance, 1e3 * o.held.lateral, 1e3 * o.held.axial,
            float(np.degrees(o.held.tilt)), 1e3 * o.sag_without, 1e3 * o.sag_held,
            f"{o.recovery:.5f}" if o.without.distance > 2e-3 else "–", o.converged,
        )
        for o in outcomes
    ]  # fmt: skip
    note = (
        "Mid-body: largest lateral distance of the backbone between base and tip from the target shape. No r where nothing moves."
    )
    return Table(title, header, rows, note)


def _shapes(outcomes: list[Outcome]) -> str:
    columns = min(4, len(outcomes))
    rows = -(-len(outcomes) // columns)
    with Drawing(rows, columns, width=10.5, height=2.9 * rows, squeeze=False) as drawing:
        for axes, o in zip(drawing.axes.flat, outcomes):
            base = base_orientation(np.radians(o.case.inclination))
            draw_robot(axes, side_view(o.target_backbone, base), REST, "target")
            draw_robot(axes, side_view(o.shape_without, base), WITHOUT, "released")
            draw_robot(axes, side_view(o.shape_held, base), REAL, "compensated")
            axes.set_title(o.case.name.replace(" towards ", "\ntowards "))
            equal_axes(axes)
        for axes in list(drawing.axes.flat)[len(outcomes) :]:
            axes.set_visible(False)
        drawing.axes.flat[0].legend(loc="lower left")
    return drawing.svg


def _course(plain: Outcome, fitted: Outcome) -> str:
    with Drawing(1, 2, width=10.5, height=3.0) as drawing:
        for axes, limit in zip(drawing.axes, (None, 2.5)):
            for outcome, colour, label in ((plain, MODEL, "not calibrated"), (fitted, REAL, "calibrated")):
                trace = outcome.trace
                axes.plot(
                    trace.time,
                    1e3 * np.linalg.norm(trace.tip_position - outcome.target.tip_position, axis=1),
                    color=colour,
                    label=label,
                )
            axes.axhline(0.0, color=TARGET, linewidth=1.0)
            axes.set_xlabel("time in s")
            axes.set_ylabel("tip error in mm")
            if limit:
                axes.set_ylim(0, limit)
                axes.set_title("enlarged")
        drawing.axes[0].legend()
    return drawing.svg
