"""Parameters of the static fit, and robots with them."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gravcomp.description import Robot
from gravcomp.materials.material_classes import class_of


@dataclass(frozen=True)
class StaticParameters:
    """Parameters of a robot with s segments, m cables and b branches of creep.

    youngs_modulus (s,) in Pa of the segments, or of the body from a file; offset (m,) in m; compliance (m,) in m/N; winding:
    ratio w; radius (m,): of each cable's place over the described one, minus 1; angle (m,) in rad, beyond the described one;
    density and payload: over the described ones; bias (3,) in m/s^2: of the measured specific force, along the axes of soft_base
    as the mount is described; mount (3,): rotation vector in rad that turns measured gravity without the bias into the true one;
    creep (b,): stiffness of each branch over the long-term one; friction: added to the coefficient of every cable; slip:
    stiffness of the friction inside the material over the long-term one (`held_back`).
    """

    youngs_modulus: np.ndarray
    offset: np.ndarray
    compliance: np.ndarray
    winding: float = 1.0
    radius: np.ndarray = None  # type: ignore[assignment]  # filled in __post_init__
    angle: np.ndarray = None  # type: ignore[assignment]
    density: float = 1.0
    payload: float = 1.0
    bias: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    mount: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    creep: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0))
    friction: float = 0.0
    slip: float = 0.0

    def __post_init__(self) -> None:
        for name in ("radius", "angle"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.zeros(len(self.offset)))

    @property
    def key(self) -> bytes:
        """All values as bytes: equal for equal parameters."""
        return b"".join(np.asarray(getattr(self, field.name), dtype=float).tobytes() for field in dataclasses.fields(self))

    def true_gravity(self, measured: np.ndarray) -> np.ndarray:
        """Return gravity (k, 3) of its right direction, in soft_base, for gravity (k, 3) that an IMU measured."""
        from scipy.spatial.transform import Rotation

        if not self.bias.any() and not self.mount.any():
            return measured
        # The specific force at rest is minus gravity; a filter gives its direction only.
        corrected = measured + self.bias
        corrected *= np.linalg.norm(measured, axis=1, keepdims=True) / np.linalg.norm(corrected, axis=1, keepdims=True)
        return np.asarray(Rotation.from_rotvec(self.mount).apply(corrected))

    def values(self, kind: str) -> np.ndarray:
        """Return the values (n,) of a kind: a field, or 'modulus'."""
        return np.atleast_1d(np.asarray(getattr(self, FIELDS.get(kind, kind)), dtype=float))

    def count(self, kind: str) -> int:
        """Return the number of values of a kind."""
        return len(self.values(kind))

    def changed(self, kind: str, index: tuple[int, ...], step: float) -> "StaticParameters":
        """Return the parameters with `step` added to the entries `index` of a kind; to the logarithm of the modulus."""
        values = self.values(kind).copy()
        at = list(index)
        values[at] = values[at] * np.exp(step) if kind == "modulus" else values[at] + step
        name = FIELDS.get(kind, kind)
        change: dict[str, Any] = {name: values if np.ndim(getattr(self, name)) else float(values[0])}
        return dataclasses.replace(self, **change)


FIELDS = {"modulus": "youngs_modulus"}
"""Kinds whose field has another name."""


def with_moduli(robot: Robot, moduli: np.ndarray) -> Robot:
    """Return the robot with these moduli (s,) in Pa of its segments, or of its body from a file; caps keep theirs."""
    return robot.with_materials(
        [dataclasses.replace(material, youngs_modulus=float(modulus)) for material, modulus in zip(robot.materials, moduli)]
    )


def with_cable_places(robot: Robot, radius: np.ndarray, angle: np.ndarray) -> Robot:
    """Return the robot with its cables farther from the axis by the shares `radius` (m,) and turned by `angle` (m,) in rad.

    Raises ValueError where a cable leaves the body.
    """
    cables = []
    for cable, share, turn in zip(robot.cables, radius.tolist(), angle.tolist()):
        if not share and not turn:
            cables.append(cable)
        elif cable.via_points is not None:
            x, y, s = np.array(cable.via_points).T
            distance, direction = (1.0 + share) * np.hypot(x, y), np.arctan2(y, x) + turn
            points = np.column_stack([distance * np.cos(direction), distance * np.sin(direction), s])
            cables.append(dataclasses.replace(cable, via_points=tuple(map(tuple, points.tolist()))))
        else:
            assert cable.radius is not None and cable.angle is not None  # Cable.__post_init__
            tip = None if cable.tip_radius is None else (1.0 + share) * cable.tip_radius
            place = {"radius": (1.0 + share) * cable.radius, "tip_radius": tip, "angle": cable.angle + turn}
            cables.append(dataclasses.replace(cable, **place))
    return dataclasses.replace(robot, cables=tuple(cables))


def starting_parameters(robot: Robot, creep_times: tuple[float, ...], *, usual_creep: bool = False) -> StaticParameters:
    """Return the parameters of the robot as it is described, with the creep that it has in the branches of these times in s.

    usual_creep: a body whose creep is not described creeps as its class of materials usually does, and rubs inside like that.
    """
    material = robot.materials[0]
    usual, slip = class_of(material.youngs_modulus), 0.0
    creep = np.zeros(len(creep_times))
    for ratio, time in material.branches if creep_times else ():
        creep[int(np.argmin(np.abs(np.log(np.array(creep_times) / time))))] += ratio
    if usual_creep and creep_times:
        slip = usual.slip
    if usual_creep and not material.branches:
        creep = creep_in_branches(usual.creep_ratio, usual.creep_time, creep_times)
    moduli = np.array([material.youngs_modulus for material in robot.materials])
    return StaticParameters(moduli, np.zeros(len(robot.cables)), cable_compliance(robot), creep=creep, slip=slip)


def creep_in_branches(ratio: Sequence[float], time: Sequence[float], times: tuple[float, ...]) -> np.ndarray:
    """Return what creep of these ratios and times in s is in branches of other `times` (b,) in s, the shortest first.

    Each counts for the nearest in the logarithm of its time; one that is nearer to a tenth of the shortest time has ended before
    the first window, and counts for none.
    """
    if not times:
        return np.zeros(0)
    branches = np.array([0.1 * min(times), *times])
    nearest = np.abs(np.log(np.asarray(time)[:, None] / branches)).argmin(axis=1)
    return np.bincount(nearest, np.asarray(ratio, dtype=float), len(branches))[1:]


def cable_compliance(robot: Robot) -> np.ndarray:
    """Return (m,) the elongation in m/N of each cable from capstan to end, from the robot's description."""
    return np.array([robot.cable_compliance(cable) for cable in robot.cables])
