"""Unknowns of the static fit: how the vector x that the solver changes stands for the parameters of a robot."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.parameters import StaticParameters
from gravcomp.calibration.statics import StaticPrediction
from gravcomp.config import parameter
from gravcomp.description import Cable, Robot
from gravcomp.materials.material_classes import class_of

MODULUS_RANGE = (0.02, 50.0)  # times the modulus at the start
_FARTHEST = 20.0  # bound of the other unknowns, in their scales
_TAUT = 1e-4  # of the largest tension: a cable with more counts as taut

GROUPS = {
    "offsets": ("offset",),
    "compliance": ("compliance",),
    "winding": ("winding",),
    "places": ("radius", "angle"),
    "weight": ("density", "payload"),
    "mount": ("mount",),
    "bias": ("bias",),
    "creep": ("creep", "slip"),
    "friction": ("friction",),
}
"""What may be fitted in addition to the moduli, and the kinds of unknowns that it means."""


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
    radius: float = parameter(
        0.01, minimum=1e-6, maximum=1.0, description="scatter of a cable's distance from the axis, relative"
    )
    angle: float = parameter(0.6, edge="deg", minimum=1e-4, maximum=90.0, description="error of a cable's angle about the axis")
    density: float = parameter(0.012, minimum=1e-6, maximum=1.0, description="error of the density, relative")
    payload: float = parameter(0.02, minimum=1e-6, maximum=1.0, description="error of the payload's mass, relative")
    mount: float = parameter(0.5, edge="deg", minimum=1e-4, maximum=90.0, description="error of the IMU's mount about each axis")
    bias: float = parameter(
        0.05, unit="m/s^2", minimum=1e-4, maximum=1.0, description="bias of an accelerometer along each axis, at its temperature"
    )
    scale: float = parameter(
        0.003, minimum=1e-6, maximum=0.5, description="error of each scale of an accelerometer, and of local gravity, relative"
    )
    creep: float = parameter(
        0.6, minimum=1e-6, maximum=100.0, description="error of a branch of creep, over the largest of the material's class"
    )
    slip: float = parameter(
        0.5, minimum=1e-6, maximum=100.0, description="error of the friction inside the material, over that of its class"
    )
    friction: float = parameter(0.05, minimum=1e-6, maximum=1.0, description="error of the cables' coefficient of friction")


@dataclass(frozen=True)
class Unknown:
    """One entry of x.

    kind: of `StaticParameters`, where x of 'modulus' is the logarithm of its ratio to the start; index: entries of that kind that
    it stands for; scale: change of the parameter per unit of x. The standard deviation of its prior is 1 in x; the moduli have
    one only for their differences.
    """

    kind: str
    index: tuple[int, ...]
    scale: float

    def lowest(self, initial: StaticParameters) -> float:
        """Return the lower bound in x."""
        if self.kind == "modulus":
            return float(np.log(MODULUS_RANGE[0]))
        if self.kind in ("compliance", "creep", "friction", "slip"):  # none of them is below zero
            return -float(initial.values(self.kind)[list(self.index)].min()) / self.scale
        return -_FARTHEST

    def highest(self) -> float:
        """Return the upper bound in x."""
        return float(np.log(MODULUS_RANGE[1])) if self.kind == "modulus" else _FARTHEST

    def derivative(self, derivatives: dict[str, np.ndarray]) -> np.ndarray:
        """Return d tip / dx (k, 6), position in m and direction, from those of `StaticPredictor.differentiate`."""
        return derivatives[self.kind][:, :, list(self.index)].sum(axis=2) * self.scale


def unknowns_of(
    robot: Robot, before: StaticPrediction, initial: StaticParameters, groups: set[str] | None, priors: Priors
) -> list[Unknown]:
    """Return the unknowns that the windows of `before`, the prediction at the start, can show.

    They are the moduli, first; of `groups` (None: all `GROUPS`): offset, place, winding of the cables that are taut in a window,
    one compliance for all cables of a segment with a taut cable, density, payload, mount, bias of the accelerometer, branches of
    creep and friction inside the material, friction of the cables.
    """
    wanted = set(GROUPS) if groups is None else groups
    taut = [c for c in range(len(robot.cables)) if (before.tension[:, c] > _TAUT * robot.limits.tension_max).any()]
    ends = [robot.cable_end(cable) for cable in robot.cables]
    unknowns = [Unknown("modulus", (s,), 1.0) for s in range(len(robot.materials))]
    if "offsets" in wanted:
        unknowns += [Unknown("offset", (c,), priors.offset_share * robot.length) for c in taut]
    if "compliance" in wanted:
        for end in sorted({ends[c] for c in taut}):
            cables = tuple(c for c in range(len(ends)) if ends[c] == end)
            scale = max(compliance_scale(robot, robot.cables[c], priors) for c in cables)
            unknowns.append(Unknown("compliance", cables, scale))
    if "winding" in wanted and taut:
        unknowns.append(Unknown("winding", (0,), priors.winding))
    if "places" in wanted:
        unknowns += [Unknown(kind, (c,), getattr(priors, kind)) for kind in ("radius", "angle") for c in taut]
    if "weight" in wanted:
        unknowns.append(Unknown("density", (0,), priors.density))
        if robot.payload.mass > 0.0:
            unknowns.append(Unknown("payload", (0,), priors.payload))
    if "mount" in wanted:
        unknowns += [Unknown("mount", (axis,), priors.mount) for axis in range(3)]
    if "bias" in wanted:
        unknowns += [Unknown("bias", (axis,), priors.bias) for axis in range(3)]
    if "creep" in wanted:
        usual = class_of(robot.materials[0].youngs_modulus)
        scale = priors.creep * max(usual.creep_ratio)
        unknowns += [Unknown("creep", (b,), scale) for b in range(len(initial.creep))]
        unknowns += [Unknown("slip", (0,), priors.slip * usual.slip)] * bool(len(initial.creep))
    if "friction" in wanted and taut:
        unknowns.append(Unknown("friction", (0,), priors.friction))
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
    found = initial
    for unknown, entry in zip(unknowns, x):
        found = found.changed(unknown.kind, unknown.index, float(entry * unknown.scale))
    return found
