"""A distal segment that is longer by 60 %: only the geometry changes; material and cables are calibrated on the short robot."""

import dataclasses

import numpy as np

from gravcomp.config import ConfigError
from gravcomp.description import Robot
from gravcomp.evaluation import metrics
from gravcomp.report.drawing import MODEL, REAL, REST, WITHOUT, Drawing, draw_robot, equal_axes, side_view
from gravcomp.report.result import Figure, Plot, Result, Table
from gravcomp.trials.calibration_run import calibrate_on_virtual_robot
from gravcomp.trials.context import Context
from gravcomp.trials.holding import GROUND, Case, Outcome, held_notes, pooled_recovery, run_cases
from gravcomp.virtual.motion import base_orientation

TITLE = "A longer distal segment"

LONGER = 1.6  # the distal segment of the article: 80 in place of 50 mm
# Points in the middle of the long segment. The moments of two cables in the plane of the sag cannot control the position and
# direction of the tip and the middle together, so the direction has no weight.
BACKBONE = {"backbone_station": (0.5, 0.6, 0.7, 0.8), "backbone_weight": (1.0, 1.0, 1.0, 1.0), "tip_direction_weight": 0.0}
INCLINATIONS = (45.0, 0.0, -45.0)


def lengthened(robot: Robot) -> Robot:
    """Return the robot with a longer distal segment; the cables end where the segments do.

    Raises ConfigError for a body from a file, and where a cable does not fit the longer segment.
    """
    if not robot.segments:
        raise ConfigError(
            f"robot '{robot.name}' has a body from a file; the experiment needs segments, the last of which it changes"
        )
    distal = dataclasses.replace(robot.segments[-1], length=LONGER * robot.segments[-1].length)
    try:
        return dataclasses.replace(robot, name=f"{robot.name}, longer", segments=(*robot.segments[:-1], distal))
    except ValueError as error:
        raise ConfigError(f"robot '{robot.name}' with a distal segment of {1e3 * distal.length:g} mm: {error}") from error


def run(context: Context) -> Result:
    """Run the experiment."""
    calibrated = context.once(calibrate_on_virtual_robot).setup
    setup = dataclasses.replace(calibrated, robot=lengthened(calibrated.robot), nominal=lengthened(calibrated.nominal))
    inclinations = INCLINATIONS[1:2] if context.brief else INCLINATIONS
    cases = [Case(i, options=options, brief=context.brief) for options in ({}, BACKBONE) for i in inclinations]
    outcomes = run_cases(context, [(setup, case) for case in cases], "robot with a longer segment")
    tip_only, weighted = outcomes[: len(inclinations)], outcomes[len(inclinations) :]
    short = run_cases(context, [(calibrated, Case(0.0, brief=context.brief))], "robot as described")[0]
    distal = setup.robot.effectors.backbone_station > 1.0 - setup.robot.segments[-1].full_length / setup.robot.length
    distal[-1] = False

    left, sag = (max(error.lateral for error in errors) for errors in zip(*((o.held, o.without) for o in tip_only)))

    def middle(o: Outcome, shape: np.ndarray) -> float:
        """Return the largest sag of the long segment between its ends, m."""
        return float(metrics.sag(shape, o.target_backbone)[distal].max())

    def worst(group: list[Outcome]) -> float:
        return max(middle(o, o.shape_held) for o in group)

    return Result(
        name="long-segment",
        title=TITLE,
        question="Does the method transfer to another robot when only the geometry is changed, and how far does the middle sag?",
        ground=GROUND,
        figures=[
            Figure("recovery rate r at rest", pooled_recovery(outcomes), "", "still works", 0.999, True, 5),
            Figure("largest lateral tip error", 1e3 * max(o.held.lateral for o in tip_only), "mm"),
            Figure("largest lateral tip error, of the sag", 100.0 * left / sag, "%"),
            Figure("largest tip error without compensation", 1e3 * max(o.without.distance for o in tip_only), "mm"),
            Figure("sag of the long segment's middle, target: tip", 1e3 * worst(tip_only), "mm", "mid-section sags"),
            Figure(
                "sag of the long segment's middle, target: tip and backbone",
                1e3 * worst(weighted),
                "mm",
                "",
                1e3 * worst(tip_only),
            ),
            Figure(
                "sag of the long segment's middle, without compensation",
                1e3 * max(middle(o, o.shape_without) for o in tip_only),
                "mm",
            ),
            Figure("largest lateral tip error, target: tip and backbone", 1e3 * max(o.held.lateral for o in weighted), "mm"),
        ],
        parts=[
            Plot(
                "Shapes with and without weights on the backbone",
                _shapes(tip_only, weighted),
                "Side view. Grey: straight. Pink: released. Blue: target with position and direction of the tip. Vermilion:"
                " target with position of the tip and points of the backbone.",
            ),
            Table(
                "All poses",
                (
                    "pose",
                    "target",
                    "tip error without, mm",
                    "with, mm",
                    "lateral, mm",
                    "tilt, deg",
                    "middle without, mm",
                    "with, mm",
                    "whole body, mm",
                ),
                [
                    (
                        f"{o.case.inclination:g}°",
                        kind,
                        1e3 * o.without.distance,
                        1e3 * o.held.distance,
                        1e3 * o.held.lateral,
                        float(np.degrees(o.held.tilt)),
                        1e3 * middle(o, o.shape_without),
                        1e3 * middle(o, o.shape_held),
                        1e3 * o.sag_held,
                    )
                    for kind, group in (("tip", tip_only), ("tip and backbone", weighted))
                    for o in group
                ],
                "Middle: largest sag of the long segment between its ends, across the straight axis; whole body: largest sag"
                " of both segments. The robot as described, horizontal, for comparison: tip error"
                f" {1e3 * short.without.distance:.1f} mm without, {1e3 * short.held.distance:.2f} mm with; whole body"
                f" {1e3 * short.sag_held:.2f} mm.",
            ),
        ],
        parameters={
            "distal segment": f"{1e3 * setup.robot.segments[-1].length:g} mm",
            "slenderness": round(setup.robot.length / setup.robot.segments[0].outer_diameter, 2),
            "backbone-weighted target": BACKBONE,
        },
        notes=[
            "Material, cable elasticity and cable offsets are those calibrated on the short robot; nothing was tuned for the"
            " long one.",
            "The cables of a segment give one moment in the plane of the sag. The two moments are used up by position and"
            " direction of the tip; the bending of a segment between the ends of its cables cannot be controlled. With weights"
            " on the middle of the long segment the direction has no weight: the tilt is larger, and the first segment sags as"
            " before.",
            *held_notes(setup, left, sag),
        ],
    )


def _shapes(tip_only: list[Outcome], weighted: list[Outcome]) -> str:
    with Drawing(1, len(tip_only), width=10.5, height=3.6, squeeze=False) as drawing:
        for axes, plain, spread in zip(drawing.axes[0], tip_only, weighted):
            base = base_orientation(np.radians(plain.case.inclination))
            draw_robot(axes, side_view(plain.target_backbone, base), REST, "straight")
            draw_robot(axes, side_view(plain.shape_without, base), WITHOUT, "released")
            draw_robot(axes, side_view(plain.shape_held, base), MODEL, "tip")
            draw_robot(axes, side_view(spread.shape_held, base), REAL, "tip and backbone")
            axes.set_title(f"{plain.case.inclination:g}°")
            equal_axes(axes)
        drawing.axes[0, 0].legend(loc="lower left")
    return drawing.svg
