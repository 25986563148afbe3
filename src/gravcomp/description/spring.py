"""A helical spring as backbone: the tube that bends, gets longer and twists as it does.

Per length of a spring with round wire of diameter d (E, G, I = pi d^4 / 64, J = 2 I), mean radius R and pitch p, whose coils are
flat (S. Timoshenko, J. Gere, Theory of Elastic Stability, 1961, section 2.17):

    bending   B = p E I G J / (pi R (E I + G J)),      axis   A = p G J / (2 pi R^3),      twist   p E I / (2 pi R).

A tube with these B and A has the outer and inner radii a, b with a^2 + b^2 = 4 B / A = 8 R^2 (1 + nu) / (2 + nu). It is wider
than the spring. With Poisson's ratio 0 it twists as stiffly as it bends, the spring 1 + nu / 2 times as stiffly.
"""

import dataclasses
import math

from gravcomp.config import parameter
from gravcomp.description.body import Material

# Inner over outer radius of the tube: a wall that is thick enough to stay round.
_THICKNESS = 0.6
# The smallest distance from coil to coil, over the wire's diameter: below it they touch as soon as a cable is taut.
_CLOSEST = 1.05


@dataclasses.dataclass(frozen=True)
class Spring:
    """The wire of a segment that is a helical spring; the segment's outer diameter and material are those of spring and wire."""

    wire_diameter: float = parameter(edge="mm", minimum=0.01, maximum=100.0, description="diameter of the wire")
    pitch: float = parameter(edge="mm", minimum=0.01, maximum=1000.0, description="distance from coil to coil at rest")

    def check(self, outer_diameter: float) -> None:
        """Raise ValueError for a spring of `outer_diameter` (m) that cannot be wound, or is none."""
        widest = outer_diameter / 3
        if self.wire_diameter > widest:
            raise ValueError(
                f"spring.wire_diameter_mm is {self.wire_diameter * 1e3:g}; allowed: up to a third of outer_diameter_mm,"
                f" {widest * 1e3:.3g}"
            )
        low, high = _CLOSEST * self.wire_diameter, outer_diameter - self.wire_diameter
        if not low <= self.pitch <= high:
            raise ValueError(
                f"spring.pitch_mm is {self.pitch * 1e3:g}; allowed: {low * 1e3:.3g} to {high * 1e3:.3g}, from"
                f" {_CLOSEST:g} x the wire's to the coils' mean diameter; describe a spring whose coils touch as a tube with the"
                " modulus that gives its sag"
            )

    def diameters(self, outer_diameter: float, poissons_ratio: float) -> tuple[float, float]:
        """Return outer and inner diameter (m) of the tube, for the wire's Poisson's ratio."""
        radius = self._radius(outer_diameter)
        squares = 8.0 * radius**2 * (1.0 + poissons_ratio) / (2.0 + poissons_ratio)
        outer = 2.0 * math.sqrt(squares / (1.0 + _THICKNESS**2))
        return outer, _THICKNESS * outer

    def tube_material(self, wire: Material, outer_diameter: float) -> Material:
        """Return the material of the tube, for that of the wire."""
        radius, nu = self._radius(outer_diameter), wire.poissons_ratio
        outer, inner = self.diameters(outer_diameter, nu)
        # E I G J / (E I + G J) = E I / (2 + nu)
        bending = self.pitch * wire.youngs_modulus * math.pi / 64 * self.wire_diameter**4 / (math.pi * radius * (2.0 + nu))
        coil = math.hypot(2 * math.pi * radius, self.pitch)
        volume = math.pi / 4 * self.wire_diameter**2 * coil / self.pitch  # of wire, per length
        return dataclasses.replace(
            wire,
            youngs_modulus=bending / (math.pi / 64 * (outer**4 - inner**4)),
            poissons_ratio=0.0,
            density=wire.density * volume / (math.pi / 4 * (outer**2 - inner**2)),
        )

    def _radius(self, outer_diameter: float) -> float:
        """Mean radius of the coils (m)."""
        return 0.5 * (outer_diameter - self.wire_diameter)
