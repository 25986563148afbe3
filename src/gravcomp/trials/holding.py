"""One case of compensation: the robot is released at a pose, then held to a target, and judged by its true shape."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop, Trace
from gravcomp.closed_loop.setup import Setup
from gravcomp.evaluation import metrics
from gravcomp.inverse import Target, bend_target
from gravcomp.inverse.target import arc_points
from gravcomp.virtual.motion import StaticMotion, base_orientation

SETTLED = 0.5  # s at the end of a phase over which it is judged
BAND = 0.5e-3  # m: converged when the tip stays within it
GROUND = (
    "Whole loop in the core at full speed against the virtual robot: CAN frames, bridge, position loops, IMU noise, orientation filter,"
    " model and inverse problem as in the running graph; 'measured' means the virtual robot's true shape."
)


@dataclass(frozen=True)
class Case:
    """inclination, roll, bend and plane in degrees; bend 0: straight. `options`: weights of `bend_target` beside the tip's."""

    inclination: float
    roll: float = 0.0
    bend: float = 0.0
    plane: float = 0.0
    released: float = 3.0  # s
    held: float = 4.0  # s
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        pose = f"{self.inclination:g}°" + (f", rolled {self.roll:g}°" if self.roll else "")
        return pose + (f", bent {self.bend:g}° towards {self.plane:g}°" if self.bend else ", straight")


@dataclass(frozen=True)
class Outcome:
    """What came of a case. SI; `without` and `held` are the true shapes at the end of both phases; station (b,), target (b, 3)."""

    case: Case
    trace: Trace
    recovery: float
    without: metrics.TipErrors
    held: metrics.TipErrors
    sag_without: float
    sag_held: float
    converged: float
    target: Target
    target_backbone: np.ndarray
    shape_without: np.ndarray
    shape_held: np.ndarray


def target_of(setup: Setup, case: Case) -> Target:
    """The case's target with the controller's own weights."""
    options = {"tip_direction_weight": setup.controller.tip_direction_weight, **case.options}
    return bend_target(setup.robot.length, np.radians(case.bend), np.radians(case.plane), **options)


def run_case(job: tuple[Setup, Case]) -> Outcome:
    """Release, hold, judge."""
    setup, case = job
    loop = ClosedLoop(setup, StaticMotion(base_orientation(np.radians(case.inclination), np.radians(case.roll))))
    target = target_of(setup, case)
    loop.release()
    loop.run(case.released)
    start = loop.time
    loop.hold(target)
    loop.run(case.held)
    trace = loop.trace
    before, after = trace.between(start - SETTLED, start), trace.between(loop.time - SETTLED)
    station = setup.robot.effectors.backbone_station
    wanted = arc_points(setup.robot.length, np.radians(case.bend), np.radians(case.plane), station)
    change = trace.between(start - SETTLED)
    distance = np.linalg.norm(change.tip_position - target.tip_position, axis=1)
    return Outcome(
        case=case,
        trace=trace,
        recovery=metrics.recovery_rate(change.tip_position, change.model_tip_position),
        without=mean_errors(before, target),
        held=mean_errors(after, target),
        sag_without=float(metrics.mid_body_sag(before.backbone, wanted).mean()),
        sag_held=float(metrics.mid_body_sag(after.backbone, wanted).mean()),
        converged=metrics.settling_time(change.time, distance, start=start, band=BAND),
        target=target,
        target_backbone=wanted,
        shape_without=before.backbone.mean(axis=0),
        shape_held=after.backbone.mean(axis=0),
    )


def mean_errors(trace: Trace, target: Target) -> metrics.TipErrors:
    """The mean tip errors over a trace, as floats."""
    return metrics.means(metrics.tip_errors(trace.tip_position, trace.tip_direction, target.tip_position, target.tip_direction))


def pooled_recovery(outcomes: list[Outcome], *, at_rest: bool = True) -> float:
    """r over all cases together: of the settled parts, released and held; or of everything from just before the targets came."""
    parts = []
    for o in outcomes:
        start = o.trace.time[o.trace.compensating][0]
        settled = [o.trace.between(start - SETTLED, start), o.trace.between(o.trace.time[-1] - SETTLED)]
        parts += settled if at_rest else [o.trace.between(start - SETTLED)]
    return metrics.recovery_rate(
        np.concatenate([p.tip_position for p in parts]), np.concatenate([p.model_tip_position for p in parts])
    )
