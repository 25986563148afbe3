"""A robot that is held, gets an unknown load at its tip, and finds it."""

import dataclasses

import numpy as np

from gravcomp.closed_loop.loop import ClosedLoop
from gravcomp.closed_loop.setup import Setup
from gravcomp.graph.parameters.virtual_load_cells import VirtualLoadCellParameters
from gravcomp.graph.parameters.virtual_tracker import VirtualTrackerParameters
from gravcomp.inverse import rest_target
from gravcomp.load_estimation import LoadEstimate, LoadEstimationOptions
from gravcomp.trials.holding import errors_to, lasting
from gravcomp.virtual.motion import StaticMotion, base_orientation

_SETTLING, _LEARNT, _FINDING, _MEASURED = (4.0, 14.0), (0.5, 1.8), (6.0, 21.0), (1.0, 3.6)  # s at least, first periods
_BRIEF, _BRIEF_ZERO = 0.125, 1.0  # of these; s, in which the errors of model and sensors are learnt in a brief case


@dataclasses.dataclass(frozen=True)
class LoadedCase:
    """An unknown load: a payload in kg, or a force (3,) in N in soft_base; sensors; inclination and roll of the base, deg.

    brief: shorter in every phase; compensated: the model carries a force that is found, as it does a payload.
    """

    payload: float = 0.0
    force: tuple[float, float, float] | None = None
    tracker: VirtualTrackerParameters | None = None
    cells: VirtualLoadCellParameters | None = None
    inclination: float = 0.0
    roll: float = 0.0
    brief: bool = False
    compensated: bool = False


@dataclasses.dataclass(frozen=True)
class LoadedOutcome:
    """estimate: mean at the end; before, after: RMS of the lateral tip error in m without load, and with it found."""

    estimate: LoadEstimate
    before: float
    after: float


def run_loaded(job: tuple[Setup, LoadedCase]) -> LoadedOutcome:
    """Hold the robot straight, zero, attach the load, and estimate it."""
    setup, case = job
    kind = "payload" if case.force is None else "force"
    start = base_orientation(np.radians(case.inclination), np.radians(case.roll))
    share = _BRIEF if case.brief else 1.0
    options = LoadEstimationOptions(kind=kind, compensate_force=case.compensated)
    if case.brief:
        options = dataclasses.replace(options, zero_time=_BRIEF_ZERO)
    loop = ClosedLoop(setup, StaticMotion(start), tracker=case.tracker, load=options, cells=case.cells)
    target = rest_target(setup.robot, tip_direction_weight=setup.direction_weight)
    loop.hold(target)
    settling, learnt, finding, measured = (share * lasting(setup, *one) for one in (_SETTLING, _LEARNT, _FINDING, _MEASURED))
    loop.run(settling)
    loop.zero_load()
    loop.run(options.zero_time + learnt)

    def lateral() -> float:
        trace = loop.trace.between(loop.time - measured)
        return float(np.sqrt(np.mean(errors_to(trace, target).lateral ** 2)))

    before = lateral()
    if case.force is None:
        loop.virtual.attach(case.payload)
    else:
        loop.virtual.push(np.array(case.force))
    loop.run(finding)
    estimates = []
    for _ in range(10):
        loop.run(measured / 10.0)
        estimates.append(loop.load)
    mean = dataclasses.replace(
        estimates[-1],
        force=np.mean([one.force for one in estimates], axis=0),
        mass=float(np.mean([one.mass for one in estimates])),
    )
    return LoadedOutcome(mean, before, lateral())
