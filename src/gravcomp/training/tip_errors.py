"""Errors of a reduced model at equilibria of the full one."""

import numpy as np

from gravcomp.cables.friction import Sliding
from gravcomp.full_model.cable_input import CableInput
from gravcomp.full_model.payload import with_payload
from gravcomp.full_model.robot_model import RobotModel
from gravcomp.full_model.wrench import PointLoads
from gravcomp.reduction.reduced_loads import ReducedLoads
from gravcomp.reduction.reduced_model import ReducedModel
from gravcomp.reduction.tracking import ReducedTracker
from gravcomp.training.samples import Sample, wrench_of


def tip_errors(model: RobotModel, reduced: ReducedModel, samples: list[Sample]) -> np.ndarray:
    """Return the distances (k,) in m of the reduced model's tip from that of each sample.

    inf: the reduced model does not converge there, and the full one would be used.
    """
    tracker = ReducedTracker(reduced, model.length)
    projected = ReducedLoads(model, reduced.basis)
    u = np.zeros_like(model.mesh.nodes)
    errors = np.full(len(samples), np.inf)
    for number, sample in enumerate(samples):
        tracker.place(
            reduced.coordinates_of @ sample.unknowns,
            sample.tension,
            Sliding(sample.pulling, np.full_like(sample.pulling, np.nan)),
        )
        loads = with_payload(model, sample.gravity, PointLoads.of(model, wrench_of(sample.load)))
        force = None if loads is None else projected.at(loads, tracker.state.q)
        state = tracker.track(sample.gravity, CableInput(tension=sample.tension), iterations=10, force=force)
        if state.converged:
            model.free(u)[:] = sample.unknowns
            tip = model.effectors.sections(model.mesh.nodes + u)[-1, 0]
            errors[number] = np.linalg.norm(reduced.tip(state.q) - tip)
    return errors
