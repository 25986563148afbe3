"""One case of compensation: the robot is released at a pose, then compensated towards a target; its true shape is evaluated."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.description import Robot
from gravcomp.evaluation import metrics
from gravcomp.holdability import holdability
from gravcomp.holdability.text import sentence
from gravcomp.inverse import Target, rest_target
from gravcomp.trials.context import Context
from gravcomp.virtual.motion import StaticMotion, base_orientation

# In first periods of the robot: the phases of a case, and the end of a phase over which errors are averaged.
_RELEASED, _HELD, _SETTLED = 12.0, 14.0, 1.8
_HELD_WELL = 0.1  # of the sag: a robot whose cables hold it keeps less
_BRIEF = 0.4  # of the phases of a brief case
_SHORTEST = 1.5  # s of a phase: filter, controller and winches need as long on the fastest robot
GROUND = (
    "The whole loop runs in the core, faster than real time, against the virtual robot: CAN frames, bridge, position loops,"
    " IMU noise, orientation filter, model and inverse problem are those of the running graph. 'Measured' means the true shape of"
    " the virtual robot."
)


@dataclass(frozen=True)
class Case:
    """Pose and target. Angles in degrees, bend: from the shape at rest; options: of `rest_target`; brief: shorter phases."""

    inclination: float
    roll: float = 0.0
    bend: float = 0.0
    plane: float = 0.0
    options: dict[str, Any] = field(default_factory=dict)
    brief: bool = False

    @property
    def name(self) -> str:
        """Description of pose and target, for tables and drawings."""
        pose = f"{self.inclination:g}°" + (f", rolled {self.roll:g}°" if self.roll else "")
        return pose + (f", bent {self.bend:g}° towards {self.plane:g}°" if self.bend else ", straight")


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case, in SI units.

    `without` and `held`: tip errors in the last `settled` s of the released and of the compensated phase; backbones (b, 3) in
    soft_base.
    """

    case: Case
    trace: Trace
    settled: float
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


def lasting(setup: Setup, shortest: float, periods: float) -> float:
    """Return the duration in s of a phase that lasts `periods` first periods of the robot, at least `shortest` s."""
    return max(shortest, periods * setup.first_period)


def target_of(setup: Setup, case: Case) -> Target:
    """Return the target of a case, with the weights of the controller."""
    options = {"tip_direction_weight": setup.direction_weight, **case.options}
    return rest_target(setup.robot, np.radians(case.bend), np.radians(case.plane), **options)


def _backbone(robot: Robot, case: Case, station: np.ndarray) -> np.ndarray:
    """Return the places (k, 3) in m of the target's backbone at the stations (k,)."""
    shape = rest_target(
        robot, np.radians(case.bend), np.radians(case.plane), backbone_station=station, backbone_weight=np.zeros(len(station))
    )
    return shape.backbone_position


def run_case(job: tuple[Setup, Case]) -> Outcome:
    """Run one case: release, compensate, evaluate. The phases last as long as the robot's first period demands."""
    setup, case = job
    settled, share = _SETTLED * setup.first_period, _BRIEF if case.brief else 1.0
    loop = ClosedLoop(setup, StaticMotion(base_orientation(np.radians(case.inclination), np.radians(case.roll))))
    target = target_of(setup, case)
    loop.release()
    loop.run(lasting(setup, _SHORTEST, share * _RELEASED))
    start = loop.time
    loop.hold(target)
    loop.run(lasting(setup, _SHORTEST, share * _HELD))
    trace = loop.trace
    before, after = trace.between(start - settled, start), trace.between(loop.time - settled)
    station = setup.robot.effectors.backbone_station
    wanted = _backbone(setup.robot, case, station)
    change = trace.between(start - settled)
    distance = np.linalg.norm(change.tip_position - target.tip_position, axis=1)
    return Outcome(
        case=case,
        trace=trace,
        settled=settled,
        recovery=metrics.recovery_rate(change.tip_position, change.model_tip_position),
        without=mean_errors(before, target),
        held=mean_errors(after, target),
        sag_without=float(metrics.mid_body_sag(before.backbone, wanted).mean()),
        sag_held=float(metrics.mid_body_sag(after.backbone, wanted).mean()),
        converged=metrics.settling_time(change.time, distance, start=start, band=metrics.CONVERGED * setup.robot.length),
        target=target,
        target_backbone=wanted,
        shape_without=before.backbone.mean(axis=0),
        shape_held=after.backbone.mean(axis=0),
    )


def run_cases(context: Context, jobs: list[tuple[Setup, Case]], stage: str) -> list[Outcome]:
    """Return the outcomes of the jobs of `run_case`; what another experiment of this context has run is not run again."""
    known = context.once(_outcomes)
    new = [(setup, case) for setup, case in jobs if not any(_is_of(entry, setup, case) for entry in known)]
    known += [(setup, outcome) for (setup, _), outcome in zip(new, context.map(run_case, new, stage))]
    return [next(entry[1] for entry in known if _is_of(entry, setup, case)) for setup, case in jobs]


def _outcomes(context: Context) -> list[tuple[Setup, Outcome]]:
    """Return the outcomes of a context, with their setups: none at first."""
    return []


def _is_of(entry: tuple[Setup, Outcome], setup: Setup, case: Case) -> bool:
    return entry[0] is setup and entry[1].case == case


def unholdable(robot: Robot) -> str | None:
    """Return why the cables cannot hold the robot straight in some direction of gravity, as a sentence; None: they can."""
    answer = holdability(robot, with_needed=False)
    return None if answer.held else sentence(robot, answer)


def held_notes(setup: Setup, residual: float, sag: float) -> list[str]:
    """Return notes about a lateral residual of a straight target and the released robot's sag, both in m.

    One that is a large share of the sag asks whether the cables can hold this robot at all; the answer is that of `model info`.
    """
    if residual <= _HELD_WELL * sag:
        return []
    reason = unholdable(setup.robot)
    share = f"{100.0 * residual / sag:.0f} % of the sag remain"
    return [f"{share}: {reason}" if reason else f"{share}, and the cables could hold the robot in every direction of gravity"]


def errors_to(trace: Trace, target: Target) -> metrics.TipErrors:
    """Return the tip errors of each sample of a trace; the target must have a tip direction."""
    assert target.tip_direction is not None
    return metrics.tip_errors(trace.tip_position, trace.tip_direction, target.tip_position, target.tip_direction)


def mean_errors(trace: Trace, target: Target) -> metrics.TipErrors:
    """Return the mean tip errors over a trace, as floats."""
    return metrics.means(errors_to(trace, target))


def pooled_recovery(outcomes: list[Outcome], *, at_rest: bool = True) -> float:
    """Return the recovery rate r over all cases together.

    at_rest: of the settled parts of both phases; otherwise of everything from `settled` s before the target is set.
    """
    parts = []
    for o in outcomes:
        start = o.trace.time[o.trace.compensating][0]
        settled = [o.trace.between(start - o.settled, start), o.trace.between(o.trace.time[-1] - o.settled)]
        parts += settled if at_rest else [o.trace.between(start - o.settled)]
    return metrics.recovery_rate(
        np.concatenate([p.tip_position for p in parts]), np.concatenate([p.model_tip_position for p in parts])
    )
