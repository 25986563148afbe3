"""Estimates of a static fit with their intervals, and why the data do not determine some of them."""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.calibration.parameters import StaticParameters
from gravcomp.calibration.unknowns import Priors, Unknown
from gravcomp.description import Robot

SEEN = 0.7  # a posterior deviation above this fraction of the prior's means that the data do not determine the value
SEEN_MODULUS = 0.1  # the same for a modulus, which has no prior of its own: relative deviation
IMPLAUSIBLE = 4.0  # in deviations of the prior: no maker is so far off, so the value stands for something else
TOLD = 0.5  # a stretch whose half interval is a larger share of it says little: none, or twice as much, would fit as well
_WEAK = 1.0 / SEEN**2 - 1.0  # information in x, below which the prior outweighs the data
_PARTNER = 0.3  # of the largest entry of a weak combination: what belongs to it

UNTOLD = {"slip": "a tip that swings before it rests loses what friction held, and does not show which sections slip"}
"""Kinds that are fitted so that nothing else stands for them, and why what is found tells nothing of the robot."""

_UNITS = {
    "modulus": ("MPa", 1e-6), "offset": ("mm", 1e3), "compliance": ("mm/N", 1e3), "radius": ("%", 100.0),
    "angle": ("deg", 180.0 / math.pi), "mount": ("deg", 180.0 / math.pi), "bias": ("m/s^2", 1.0),
}  # fmt: skip


def edge_unit(kind: str) -> tuple[str, float]:
    """Return the unit of a kind in its estimates, and the factor to it from that in `StaticParameters`."""
    return _UNITS.get(kind, ("", 1.0))


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter in its edge unit.

    interval: half width at 95 %; seen: whether the data determine it; one that they do not keeps the value `initial`, and its
    interval says how little they show. kind and index: of the unknown.
    """

    name: str
    unit: str
    initial: float
    value: float
    interval: float
    seen: bool
    reason: str = ""  # why it is not fitted
    kind: str = ""
    index: int = 0


def name_of(robot: Robot, unknown: Unknown, times: tuple[float, ...] = ()) -> str:
    """Return the name of an unknown; times: of the branches of creep in s."""
    first = unknown.index[0]
    if unknown.kind == "modulus":
        return "Young's modulus" + (f" of {robot.segments[first].name}" if len(robot.materials) > 1 else "")
    if unknown.kind in ("offset", "compliance", "radius", "angle"):
        return f"{unknown.kind} of {', '.join(robot.cables[c].name for c in unknown.index)}"
    if unknown.kind == "creep":
        return f"creep of about {times[first]:.3g} s"
    names = {
        "winding": "winding ratio", "density": "density ratio", "payload": "payload ratio",
        "friction": "friction beyond the described one", "slip": "friction inside the material",
        "mount": f"mount of the IMU about {'xyz'[min(first, 2)]}",
        "bias": f"bias of the accelerometer along {'xyz'[min(first, 2)]}",
    }  # fmt: skip
    return names[unknown.kind]


def unfit(unknown: Unknown, value: float, sigma: float, half: float, partners: list[str], initial: float = 0.0) -> str:
    """Return why an unknown is not fitted, empty where data determine it; value, deviation and half interval are in x.

    partners: names of what moves no tip if it changes together with this one; initial: the described value, in units of x.
    """
    if unknown.kind == "modulus":
        return ""
    if sigma >= SEEN:
        if partners:
            return f"changed together with {', '.join(partners)}, it moves no tip: the data show one combination of them only"
        return f"its interval would be {half / 1.96:.0%} of what was assumed before; less than {SEEN:.0%} is needed"
    found = initial + value
    if unknown.kind == "compliance" and abs(value) <= half and half > TOLD * max(found, initial):
        share = f"± {half / found:.0%} of it" if found > 0.0 else "more than all of it"
        return f"its interval contains the described value and is {share}; less than ± {TOLD:.0%} is needed"
    if unknown.kind == "winding" and abs(value) > IMPLAUSIBLE:
        found, most = 1.0 + value * unknown.scale, IMPLAUSIBLE * unknown.scale
        return f"{found:.3f} fits best, and no capstan is wrong by more than {most:.0%}: the description is wrong elsewhere"
    return ""


def fitted_together(unknowns: list[Unknown], reasons: list[str]) -> list[str]:
    """Return the reasons without those of the IMU's errors, where the data show one of these.

    Mount and bias tilt the same gravity: a mount that is fitted without the bias stands for it in the measured poses, and is
    wrong in all others. Fitted together, what the data do not show stays near its prior.
    """
    of_imu = [unknown.kind in ("mount", "bias") for unknown in unknowns]
    if all(reason for reason, own in zip(reasons, of_imu) if own):
        return reasons
    return ["" if own else reason for reason, own in zip(reasons, of_imu)]


def moduli_told(unknowns: list[Unknown], reasons: list[str], covariance: np.ndarray) -> list[str]:
    """Return the reasons with one for the moduli, where the data tell neither one of them nor their common error.

    covariance (u, u): of x. Where they tell one, the others follow it by their prior, which is nearer than what is described.
    """
    own = np.array([unknown.kind == "modulus" for unknown in unknowns])
    block = covariance[np.ix_(own, own)]
    deviation = float(np.sqrt(min(block.mean(), np.diag(block).min())))
    if deviation < SEEN_MODULUS:
        return reasons
    reason = f"its deviation would be {deviation:.0%}; less than {SEEN_MODULUS:.0%} is needed"
    return [reason if is_modulus else other for is_modulus, other in zip(own, reasons)]


def partners_of(information: np.ndarray, unknowns: list[Unknown], priors: Priors) -> list[list[int]]:
    """Return for each unknown those that no tip tells apart from it, by the weak eigenvectors of the information (u, u) in x.

    The moduli have no prior of their own; their entries count in deviations of their scatter.
    """
    scale = np.array([priors.moduli if unknown.kind == "modulus" else 1.0 for unknown in unknowns])
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    weak = vectors[:, values < _WEAK]
    found: list[list[int]] = []
    for i in range(len(unknowns)):
        if not weak.shape[1] or np.abs(weak[i]).max() < _PARTNER:
            found.append([])
            continue
        # What in all weak combinations goes along with this one: its projection onto them.
        along = weak @ weak[i]
        found.append([j for j in range(len(unknowns)) if j != i and abs(along[j]) >= _PARTNER * abs(along[i])])
    return found


def estimate(
    robot: Robot,
    unknown: Unknown,
    initial: StaticParameters,
    final: StaticParameters,
    half: float,
    sigma: float,
    reason: str,
    times: tuple[float, ...] = (),
) -> Estimate:
    """Return the estimate of an unknown; half width of its interval and standard deviation sigma are in x."""
    first, (unit, factor) = unknown.index[0], edge_unit(unknown.kind)
    before, value = (float(factor * p.values(unknown.kind)[first]) for p in (initial, final))
    name = name_of(robot, unknown, times)
    if unknown.kind == "modulus":
        return Estimate(name, unit, before, value, value * half, bool(sigma < SEEN_MODULUS), reason, "modulus", first)
    seen = not reason and unknown.kind not in UNTOLD
    return Estimate(name, unit, before, value, factor * unknown.scale * half, seen, reason, unknown.kind, first)


def warnings(robot: Robot, unknowns: list[Unknown], estimates: tuple[Estimate, ...], driven: bool) -> list[str]:
    """Return sentences about the parameters that these data do not determine. driven: whether cables were pulled in the data."""
    found = []
    with_offset = {u.index[0] for u in unknowns if u.kind == "offset"}
    slack = [cable.name for i, cable in enumerate(robot.cables) if i not in with_offset]
    if slack and with_offset:
        found.append(f"{', '.join(slack)}: never taut in these data, so the offset cannot be fitted and keeps its value")
    if not with_offset and driven:
        found.append("no cable is ever taut in these data: only the modulus was fitted")
    for reason in dict.fromkeys(e.reason for e in estimates if e.reason):
        alike = [e for e in estimates if e.reason == reason]
        kept = ", ".join(dict.fromkeys(f"{e.initial:.4g} {e.unit}".strip() for e in alike))
        names = ", ".join(e.name for e in alike)
        found.append(f"{names}: cannot be told from these data, and keeps {kept}: {reason}")
    found += [
        f"{e.name}: these data hardly determine it (± {e.interval:.2g} {e.unit}); it follows the other segments"
        for e in estimates
        if not e.seen and e.kind == "modulus" and not e.reason
    ]
    found += [
        f"{e.name}: fitted, so that moduli and creep do not stand for it, but not told (± {e.interval:.2g}): {UNTOLD[e.kind]}"
        for e in estimates
        if e.kind in UNTOLD and not e.reason
    ]
    return found
