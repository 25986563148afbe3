"""The line that a cable is made of, and its way from the capstan to the robot: stiffness, free length, friction, pretension.

A line of stiffness E A stretches under tension along its whole length, in the robot and between capstan and robot. A
material stands for E over the full circle of the diameter, so that E A = E pi d^2 / 4; braids and ropes fill only part of it.
"""

import dataclasses
import math
from typing import TYPE_CHECKING

from gravcomp.config import parameter

if TYPE_CHECKING:
    from typing import Self

# Pa. Solid wire and monofilament: the material's own modulus. Rope 7x7: makers' tables for elastic stretch over the full circle.
# Braids: fibre (100 GPa UHMWPE, 80 GPa aramid), about half of the circle filled, and the braid's angle. Braids and nylon
# scatter by +-30 % between makers, and nylon with moisture: `axial_stiffness` or a calibration is better.
CABLE_MATERIALS = {
    "steel_wire": 200e9,
    "steel_rope": 57e9,
    "nitinol": 60e9,
    "nylon": 2.5e9,
    "dyneema": 40e9,
    "kevlar": 35e9,
}
"""Young's modulus in Pa over the full circle of the diameter, by the name of the material."""

ASSUMED_STRETCH = 2e-3
"""Stretch at the largest tension of a line that nobody describes: of one that is chosen for its load, as wires and braids are."""

ASSUMED_FREE_LENGTH = 2.0
"""Length between capstan and robot where nobody gives it, over the robot's length."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CableLine:
    """What a line is made of and how it comes to the robot. None: not given; `Robot.cable_defaults` fills it, if it can."""

    material: str | None = parameter(
        None,
        choices=tuple(CABLE_MATERIALS),
        description="material of the line, with diameter_mm; the loop assumes a line when not given",
    )
    diameter: float | None = parameter(None, edge="mm", minimum=0.005, maximum=20.0, description="diameter of the line")
    axial_stiffness: float | None = parameter(
        None,
        unit="N",
        minimum=1.0,
        maximum=1e9,
        description="E A of the line, instead of a material; the loop assumes a line when not given",
    )
    free_length: float | None = parameter(
        None,
        edge="mm",
        minimum=0.0,
        maximum=20000.0,
        description="length between capstan and robot; the loop assumes twice the robot's when not given",
    )
    friction: float | None = parameter(
        None, minimum=0.0, maximum=2.0, description="capstan friction coefficient along sheath and robot; 0 when not given"
    )
    sheath_angle: float | None = parameter(
        None,
        edge="deg",
        minimum=0.0,
        maximum=3600.0,
        description="angle that the line turns through between capstan and robot; 0 when not given",
    )
    pretension: float | None = parameter(
        None,
        unit="N",
        minimum=0.0,
        maximum=1000.0,
        description="smallest tension of the cable; limits.tension_min when not given",
    )

    def __post_init__(self) -> None:
        if self.axial_stiffness is not None and (self.material is not None or self.diameter is not None):
            given = " and ".join(key for key in ("material", "diameter") if getattr(self, key) is not None)
            raise ValueError(
                f"axial_stiffness and {given.replace('diameter', 'diameter_mm')} are given; give axial_stiffness, or material"
                " with diameter_mm"
            )

    def filled(self, defaults: "CableLine") -> "Self":
        """Return this line with what is not given taken from `defaults`. Stiffness counts as one: its own or the default's."""
        changes = {
            field.name: getattr(defaults, field.name)
            for field in dataclasses.fields(CableLine)
            if getattr(self, field.name) is None and getattr(defaults, field.name) is not None
        }
        if self.axial_stiffness is not None:
            changes.pop("material", None)
            changes.pop("diameter", None)
        if self.material is not None or self.diameter is not None:
            changes.pop("axial_stiffness", None)
        return dataclasses.replace(self, **changes) if changes else self

    def check_stiffness(self) -> None:
        """Raise ValueError for a material without a diameter, or a diameter without a material."""
        if (self.material is None) != (self.diameter is None):
            found, missing = ("material", "diameter_mm") if self.diameter is None else ("diameter_mm", "material")
            one_of = "" if self.diameter is None else f", one of {', '.join(CABLE_MATERIALS)}"
            raise ValueError(f"{found} is given without {missing}{one_of}; a material and a diameter together give the stiffness")

    def assumed(self, tension_max: float, length: float) -> "Self":
        """Return the line with what is assumed where nothing is said of it, on a robot of `length` m with `tension_max` N."""
        line = self if self.stretches else dataclasses.replace(self, axial_stiffness=tension_max / ASSUMED_STRETCH)
        return line if line.free_length is not None else dataclasses.replace(line, free_length=ASSUMED_FREE_LENGTH * length)

    def with_stiffness(self, stiffness: float | None) -> "Self":
        """Return the line with the stiffness E A in N in place of its material; None: without stretch."""
        return dataclasses.replace(self, axial_stiffness=stiffness, material=None, diameter=None)

    def without_line(self) -> "Self":
        """Return the line without stretch, friction, free length and pretension."""
        return dataclasses.replace(self, **dict.fromkeys(field.name for field in dataclasses.fields(CableLine)))

    @property
    def stiffness(self) -> float:
        """E A in N; infinite for a line without stretch."""
        if self.axial_stiffness is not None:
            return self.axial_stiffness
        if self.material is not None and self.diameter is not None:
            return CABLE_MATERIALS[self.material] * math.pi * self.diameter**2 / 4
        return math.inf

    @property
    def stretches(self) -> bool:
        """Whether the line has a finite stiffness."""
        return math.isfinite(self.stiffness)
