"""Unknowns of the static fit: how the vector x that the solver changes stands for the parameters of a robot."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.statics import StaticParameters, StaticPrediction
from gravcomp.config import parameter
from gravcomp.description import Cable, Robot

MODULUS_RANGE = (0.02, 50.0)  # times the modulus at the start
_FARTHEST = 20.0  # bound of the other unknowns, in their scales
_TAUT = 1e-4  # of the largest tension: a cable with more counts as taut


@dataclass(frozen=True)
class Priors:
    """Standard deviations that are assumed before the measurement, without a unit, so that they suit a robot of any size."""

    offset_share: float = parameter(0.01, minimum=1e-6, maximum=1.0, description="zero of a cable, over the robot's length")
    stretch: float = parameter(
        0.01, minimum=1e-6, maximum=1.0, description="error of a line's stretch at the largest tension, over its length"
    )
    winding: float = parameter(0.02, minimum=1e-6, maximum=1.0, description="error of capstan and pitch radii, relative")
    moduli: float = parameter(
        0.15, minimum=1e-4, maximum=10.0, description="scatter of the segments' moduli about their common error, relative"
    )


@dataclass(frozen=True)
class Unknown:
    """One entry of x.

    kind: 'modulus' (x is the logarithm of its ratio to the start), 'offset', 'compliance' or 'winding'; index: of the cables
    that it stands for, or of the segment; scale: change of the parameter per unit of x. The standard deviation of its prior is 1
    in x; the moduli have one only for their differences.
    """

    kind: str
    index: tuple[int, ...]
    scale: float

    def lowest(self, initial: StaticParameters) -> float:
        """Return the lower bound in x."""
        if self.kind == "modulus":
            return float(np.log(MODULUS_RANGE[0]))
        if self.kind == "compliance":  # a cable cannot become shorter under tension
            return -float(initial.compliance[list(self.index)].min()) / self.scale
        return -_FARTHEST

    def highest(self) -> float:
        """Return the upper bound in x."""
        return float(np.log(MODULUS_RANGE[1])) if self.kind == "modulus" else _FARTHEST

    def derivative(self, prediction: StaticPrediction) -> np.ndarray:
        """Return d tip / dx (k, 6), position in m and direction."""
        if self.kind == "modulus":
            return prediction.by_modulus[:, :, self.index[0]] * self.scale
        if self.kind == "winding":
            return prediction.by_winding * self.scale
        by_cable = prediction.by_offset if self.kind == "offset" else prediction.by_compliance
        return by_cable[:, :, list(self.index)].sum(axis=2) * self.scale


def unknowns_of(
    robot: Robot, before: StaticPrediction, offsets: bool, compliance: bool, winding: bool, priors: Priors
) -> list[Unknown]:
    """Return the unknowns that the windows of `before`, the prediction at the start, can show.

    They are the moduli, first; an offset for every cable that is taut in a window; one compliance for all cables of a segment
    with a taut cable; the winding ratio if any cable is taut.
    """
    taut = [c for c in range(len(robot.cables)) if (before.tension[:, c] > _TAUT * robot.limits.tension_max).any()]
    ends = [robot.cable_end(cable) for cable in robot.cables]
    unknowns = [Unknown("modulus", (s,), 1.0) for s in range(len(robot.materials))]
    if offsets:
        unknowns += [Unknown("offset", (c,), priors.offset_share * robot.length) for c in taut]
    if compliance:
        for end in sorted({ends[c] for c in taut}):
            cables = tuple(c for c in range(len(ends)) if ends[c] == end)
            scale = max(compliance_scale(robot, robot.cables[c], priors) for c in cables)
            unknowns.append(Unknown("compliance", cables, scale))
    if winding and taut:
        unknowns.append(Unknown("winding", tuple(taut), priors.winding))
    return unknowns


def compliance_scale(robot: Robot, cable: Cable, priors: Priors) -> float:
    """Return the prior's deviation of a cable's compliance in m/N: of its own line, or of one as long as the robot twice over."""
    length = max(robot.line_length(cable), 2.0 * robot.length)
    return priors.stretch * length / robot.limits.tension_max


def prior_rows(unknowns: list[Unknown], priors: Priors) -> np.ndarray:
    """Return the rows R of the prior's residuals R x: all entries but the moduli, and the moduli about their mean."""
    rows = np.eye(len(unknowns))
    moduli = [i for i, unknown in enumerate(unknowns) if unknown.kind == "modulus"]
    rows[np.ix_(moduli, moduli)] = (np.eye(len(moduli)) - 1.0 / len(moduli)) / priors.moduli
    return rows


def parameters_at(x: np.ndarray, unknowns: list[Unknown], initial: StaticParameters) -> StaticParameters:
    """Return the parameters at x; `initial` are those at x = 0."""
    modulus, offset, own = (array.copy() for array in (initial.youngs_modulus, initial.offset, initial.compliance))
    ratio = initial.winding
    for unknown, entry in zip(unknowns, x):
        index = list(unknown.index)
        if unknown.kind == "modulus":
            modulus[index] = initial.youngs_modulus[index] * np.exp(entry * unknown.scale)
        elif unknown.kind == "offset":
            offset[index] = initial.offset[index] + entry * unknown.scale
        elif unknown.kind == "winding":
            ratio += float(entry * unknown.scale)
        else:
            own[index] = initial.compliance[index] + entry * unknown.scale
    return StaticParameters(modulus, offset, own, ratio)
