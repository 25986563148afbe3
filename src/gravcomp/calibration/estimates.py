"""Estimates of a static fit with their intervals, and warnings about parameters that the data do not determine."""

from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.measured import StillWindows
from gravcomp.calibration.statics import StaticParameters
from gravcomp.calibration.unknowns import Unknown
from gravcomp.description import Robot

SEEN = 0.7  # a posterior deviation above this fraction of the prior's means that the data do not determine the value
SEEN_MODULUS = 0.1  # the same for a modulus, which has no prior of its own: relative deviation
IMPLAUSIBLE = 4.0  # in deviations of the prior: no maker is so far off, so the value stands for something else
CORRELATED = 0.95


def unfit(unknown: Unknown, value: float, sigma: float, half: float) -> str:
    """Return why an unknown is not fitted, empty where data determine it; value, deviation and half interval are in x."""
    if unknown.kind == "modulus":
        return ""
    if sigma >= SEEN:
        return f"its interval would be {half / 1.96:.0%} of what was assumed before; less than {SEEN:.0%} is needed"
    if unknown.kind == "winding" and abs(value) > IMPLAUSIBLE:
        found, most = 1.0 + value * unknown.scale, IMPLAUSIBLE * unknown.scale
        return f"{found:.3f} fits best, and no capstan is wrong by more than {most:.0%}: the description is wrong elsewhere"
    return ""


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter in its edge unit.

    interval: half width at 95 %; seen: whether the data determine it; one that they do not keeps the value `initial`, and its
    interval says how little they show.
    """

    name: str
    unit: str
    initial: float
    value: float
    interval: float
    seen: bool
    reason: str = ""  # why it is not fitted


def estimate(
    robot: Robot,
    unknown: Unknown,
    initial: StaticParameters,
    final: StaticParameters,
    half: float,
    sigma: float,
    reason: str,
) -> Estimate:
    """Return the estimate of an unknown; half width of its interval and standard deviation sigma are in x."""
    cables, interval = list(unknown.index), unknown.scale * half
    if unknown.kind == "modulus":
        s = cables[0]
        name = "Young's modulus" + (f" of {robot.segments[s].name}" if len(robot.materials) > 1 else "")
        before, value = initial.youngs_modulus[s] * 1e-6, final.youngs_modulus[s] * 1e-6
        return Estimate(name, "MPa", before, value, value * half, sigma < SEEN_MODULUS)
    names, seen = ", ".join(robot.cables[c].name for c in cables), not reason
    if unknown.kind == "offset":
        return Estimate(f"offset of {names}", "mm", 0.0, 1e3 * final.offset[cables[0]], 1e3 * interval, seen, reason)
    if unknown.kind == "winding":
        return Estimate("winding ratio", "", initial.winding, final.winding, interval, seen, reason)
    before, after = 1e3 * initial.compliance[cables[0]], 1e3 * final.compliance[cables[0]]
    return Estimate(f"compliance of {names}", "mm/N", before, after, 1e3 * interval, seen, reason)


def warnings(
    robot: Robot, windows: StillWindows, unknowns: list[Unknown], estimates: tuple[Estimate, ...], covariance: np.ndarray
) -> list[str]:
    """Return sentences about the parameters that these data do not determine."""
    found = []
    with_offset = {u.index[0] for u in unknowns if u.kind == "offset"}
    slack = [cable.name for i, cable in enumerate(robot.cables) if i not in with_offset]
    if slack and with_offset:
        found.append(f"{', '.join(slack)}: never taut in these data, so the offset cannot be fitted and keeps its value")
    if not with_offset and np.isfinite(windows.displacement).any():
        found.append("no cable is ever taut in these data: only the modulus was fitted")
    found += [
        f"{e.name}: cannot be told from these data, and keeps {f'{e.initial:.4g} {e.unit}'.strip()}: {e.reason}"
        for u, e in zip(unknowns, estimates)
        if not e.seen and u.kind != "modulus"
    ]
    found += [
        f"{e.name}: these data hardly determine it (± {e.interval:.2g} {e.unit})"
        for u, e in zip(unknowns, estimates)
        if not e.seen and u.kind == "modulus"
    ]
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    for i in range(len(estimates)):
        for j in range(i):
            if estimates[i].seen and estimates[j].seen and abs(correlation[i, j]) > CORRELATED:
                found.append(
                    f"{estimates[j].name} and {estimates[i].name} can hardly be distinguished"
                    f" (correlation {correlation[i, j]:+.2f}): add poses in other directions"
                )
    return found
