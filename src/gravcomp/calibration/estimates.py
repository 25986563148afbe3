"""Estimates of a static fit with their intervals, and warnings about parameters that the data do not determine."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.statics import StaticParameters
from gravcomp.calibration.unknowns import Unknown
from gravcomp.description import Robot

SEEN = 0.7  # a posterior deviation above this fraction of the prior's means that the data do not determine the value
SEEN_MODULUS = 0.25  # the same for the modulus, which has no prior: relative deviation
CORRELATED = 0.95


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter in its edge unit. interval: half width at 95 %; seen: whether the data determine it, not the prior."""

    name: str
    unit: str
    initial: float
    value: float
    interval: float
    seen: bool


def estimate(
    robot: Robot, unknown: Unknown, initial: StaticParameters, final: StaticParameters, half: float, sigma: float
) -> Estimate:
    """Return the estimate of an unknown; half width of its interval and standard deviation sigma are in x."""
    cables = list(unknown.cables)
    names = ", ".join(robot.cables[c].name for c in cables)
    interval, seen = unknown.scale * half, sigma < SEEN
    if unknown.kind == "modulus":
        value = final.youngs_modulus * 1e-6
        return Estimate("Young's modulus", "MPa", initial.youngs_modulus * 1e-6, value, value * half, sigma < SEEN_MODULUS)
    if unknown.kind == "offset":
        return Estimate(f"offset of {names}", "mm", 0.0, 1e3 * final.offset[cables[0]], 1e3 * interval, seen)
    if unknown.kind == "winding":
        return Estimate("winding ratio", "", initial.winding, final.winding, interval, seen)
    before, after = 1e3 * initial.compliance[cables[0]], 1e3 * final.compliance[cables[0]]
    return Estimate(f"compliance of {names}", "mm/N", before, after, 1e3 * interval, seen)


def warnings(
    robot: Robot, windows: StillWindows, unknowns: list[Unknown], estimates: tuple[Estimate, ...], covariance: np.ndarray
) -> list[str]:
    """Return sentences about the parameters that these data do not determine."""
    found = []
    with_offset = {u.cables[0] for u in unknowns if u.kind == "offset"}
    slack = [cable.name for i, cable in enumerate(robot.cables) if i not in with_offset]
    if slack and with_offset:
        found.append(f"{', '.join(slack)}: never taut in these data, so the offset cannot be fitted and keeps its value")
    if not with_offset and np.isfinite(windows.displacement).any():
        found.append("no cable is ever taut in these data: only the modulus was fitted")
    found += [
        f"{e.name}: these data hardly determine it (± {e.interval:.2g} {e.unit}); it stays near the value assumed before"
        for e in estimates
        if not e.seen
    ]
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    for i in range(len(estimates)):
        for j in range(i):
            if abs(correlation[i, j]) > CORRELATED:
                found.append(
                    f"{estimates[j].name} and {estimates[i].name} can hardly be distinguished"
                    f" (correlation {correlation[i, j]:+.2f}): add poses in other directions"
                )
    return found
