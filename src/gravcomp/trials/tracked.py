"""A robot whose model is wrong, held with and without a tracker of its tip."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.closed_loop.trace import Trace
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.inverse import rest_target
from gravcomp.trials.holding import errors_to, lasting
from gravcomp.virtual.motion import BaseMotion, RotationMotion, StaticMotion, base_orientation

STRONG_CREEP = ((0.10, 0.10, 0.15), (0.2, 2.0, 20.0))
"""Maxwell branches of the body that creeps: stiffness over the long-term stiffness, and relaxation time in s."""

# s, and first periods of the robot; the longer counts. A tracker at 5 Hz needs some seconds for any robot.
_RELEASED, _SETTLING, _HELD = (3.0, 10.0), (4.0, 14.0), (8.0, 0.0)
_LAST = (0.5, 1.7)  # of the released phase, which counts
_BRIEF = 0.125  # of the three


@dataclass(frozen=True)
class TrackedCase:
    """A pose of the base (deg), how fast it turns about its y axis once held (deg/s), and the tracker; None: there is none.

    brief: released and held for a shorter time.
    """

    inclination: float
    roll: float = 0.0
    turning: float = 0.0
    tracker: VirtualTrackerParameters | None = None
    brief: bool = False


@dataclass(frozen=True)
class TrackedOutcome:
    """RMS of the true lateral error in m: released, and held after the settling time; used and refused: measurements."""

    released: float
    held: float
    used: int
    refused: int


def with_wrong_model(setup: Setup, stiffness: float) -> Setup:
    """Return the setup with a virtual robot that creeps strongly and whose modulus is `stiffness` times the described one."""
    ratio, time = STRONG_CREEP
    body = dataclasses.replace(
        setup.truth.body, youngs_modulus=None, modulus_ratio=(stiffness,), creep_ratio=ratio, creep_time=time
    )
    return dataclasses.replace(setup, truth=dataclasses.replace(setup.truth, body=body))


def run_tracked(job: tuple[Setup, TrackedCase]) -> TrackedOutcome:
    """Release the robot, hold it straight, and compare its true tip with the target."""
    setup, case = job
    share = _BRIEF if case.brief else 1.0
    start = base_orientation(np.radians(case.inclination), np.radians(case.roll))
    released, settling, held = (share * lasting(setup, *phase) for phase in (_RELEASED, _SETTLING, _HELD))
    last = min(released, lasting(setup, *_LAST))
    motion: BaseMotion = StaticMotion(start)
    if case.turning:
        motion = RotationMotion(start, np.array([0.0, 1.0, 0.0]), np.radians(case.turning), released + settling)
    loop = ClosedLoop(setup, motion, tracker=case.tracker)
    target = rest_target(setup.robot, tip_direction_weight=setup.direction_weight)
    loop.release()
    loop.run(released)
    begin = loop.time
    loop.hold(target)
    loop.run(settling + held)

    def lateral(trace: Trace) -> float:
        return float(np.sqrt(np.mean(errors_to(trace, target).lateral ** 2)))

    trace, status = loop.trace, loop.observer.status(loop.time)
    return TrackedOutcome(
        released=lateral(trace.between(begin - last, begin)),
        held=lateral(trace.between(begin + settling)),
        used=status.used,
        refused=status.refused,
    )
