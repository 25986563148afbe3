"""Unknowns of the static fit: how the vector x that the solver changes stands for the parameters of a robot."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.statics import StaticParameters, StaticPrediction
from gravcomp.description import Robot

OFFSET_PRIOR = 1e-3  # m
COMPLIANCE_PRIOR = 0.5e-3  # m/N
WINDING_PRIOR = 0.02
MODULUS_RANGE = (0.02, 50.0)  # times the modulus at the start
_FARTHEST = 20.0  # bound of the other unknowns, in their scales
_TAUT = 1e-4  # N


@dataclass(frozen=True)
class Unknown:
    """One entry of x.

    kind: 'modulus' (x is the logarithm of its ratio to the start), 'offset', 'compliance' or 'winding'; cables: indices of the
    cables that it stands for; scale: change of the parameter per unit of x. The standard deviation of its prior is 1 in x; the
    modulus has no prior.
    """

    kind: str
    cables: tuple[int, ...]
    scale: float

    def lowest(self, initial: StaticParameters) -> float:
        """Return the lower bound in x."""
        if self.kind == "modulus":
            return float(np.log(MODULUS_RANGE[0]))
        if self.kind == "compliance":  # a cable cannot become shorter under tension
            return -float(initial.compliance[list(self.cables)].min()) / self.scale
        return -_FARTHEST

    def highest(self) -> float:
        """Return the upper bound in x."""
        return float(np.log(MODULUS_RANGE[1])) if self.kind == "modulus" else _FARTHEST

    def derivative(self, prediction: StaticPrediction, modulus: float) -> np.ndarray:
        """Return d tip / dx (k, 3) in m; modulus in Pa."""
        if self.kind == "modulus":
            return prediction.by_modulus * modulus * self.scale
        if self.kind == "winding":
            return prediction.by_winding * self.scale
        by_cable = prediction.by_offset if self.kind == "offset" else prediction.by_compliance
        return by_cable[:, :, list(self.cables)].sum(axis=2) * self.scale


def unknowns_of(robot: Robot, before: StaticPrediction, offsets: bool, compliance: bool, winding: bool) -> list[Unknown]:
    """Return the unknowns that the windows of `before`, the prediction at the start, can show.

    They are the modulus, first; an offset for every cable that is taut in a window; one compliance for all cables of a segment
    with a taut cable; the winding ratio if any cable is taut.
    """
    taut = [c for c in range(len(robot.cables)) if (before.tension[:, c] > _TAUT).any()]
    ends = [robot.cable_end(cable) for cable in robot.cables]
    unknowns = [Unknown("modulus", (), 1.0)]
    if offsets:
        unknowns += [Unknown("offset", (c,), OFFSET_PRIOR) for c in taut]
    if compliance:
        for end in sorted({ends[c] for c in taut}):
            unknowns.append(Unknown("compliance", tuple(c for c in range(len(ends)) if ends[c] == end), COMPLIANCE_PRIOR))
    if winding and taut:
        unknowns.append(Unknown("winding", tuple(taut), WINDING_PRIOR))
    return unknowns


def parameters_at(x: np.ndarray, unknowns: list[Unknown], initial: StaticParameters) -> StaticParameters:
    """Return the parameters at x; `initial` are those at x = 0."""
    modulus, offset, own, ratio = initial.youngs_modulus, initial.offset.copy(), initial.compliance.copy(), initial.winding
    for unknown, entry in zip(unknowns, x):
        cables = list(unknown.cables)
        if unknown.kind == "modulus":
            modulus = initial.youngs_modulus * float(np.exp(entry * unknown.scale))
        elif unknown.kind == "offset":
            offset[cables] = entry * unknown.scale
        elif unknown.kind == "winding":
            ratio += float(entry * unknown.scale)
        else:
            own[cables] = initial.compliance[cables] + entry * unknown.scale
    return StaticParameters(modulus, offset, own, ratio)
