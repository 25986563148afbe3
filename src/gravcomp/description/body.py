"""What the robot's body is made of: materials, caps, and how tubes are divided into elements."""

import dataclasses
import math

from gravcomp.config import parameter
from gravcomp.description.law_stability import RANGE_OF_USE, yeoh_falls

# The constants that a law has of its own, by their fields of `Material`. `materials.laws` has the laws.
OWN_CONSTANTS = {"mooney_rivlin": ("c01_ratio",), "yeoh": ("c20_ratio", "c30_ratio")}

# Below it (kg/m^3) there are no solids but aerogels: the number is in another unit.
_LIGHTEST = 10.0


@dataclasses.dataclass(frozen=True)
class PronyTerm:
    """A term of a Prony series: a part of the stiffness that relaxes within a time."""

    share: float = parameter(minimum=1e-6, maximum=0.99, description="part of the instantaneous stiffness that relaxes")
    time: float = parameter(edge="s", minimum=1e-3, maximum=1e7, description="relaxation time")


@dataclasses.dataclass(frozen=True)
class Fibres:
    """Fibres in the body, evenly spread: along the axis, around it, or wound about it both ways, as in a braid."""

    ratio: float = parameter(
        minimum=0.0, maximum=1e4, description="stiffness of all fibres along themselves, over Young's modulus of the body"
    )
    angle: float = parameter(0.0, edge="deg", minimum=0.0, maximum=90.0, description="angle to the axis; 0: along it, 90: hoops")


@dataclasses.dataclass(frozen=True)
class Material:
    """A soft material, isotropic but for its fibres."""

    law: str = parameter(
        "neo_hookean",
        choices=("svk", "neo_hookean", "mooney_rivlin", "yeoh"),
        description="St. Venant-Kirchhoff, neo-Hookean, Mooney-Rivlin or Yeoh; all but the first for large strains",
    )
    youngs_modulus: float = parameter(0.8, edge="MPa", minimum=1e-3, maximum=1e6, description="Young's modulus")
    poissons_ratio: float = parameter(0.45, minimum=0.0, maximum=0.4999, description="Poisson's ratio")
    _: dataclasses.KW_ONLY  # by position, a density once was taken for the constant of a law
    c01_ratio: float = parameter(0.25, minimum=0.0, maximum=100.0, description="Mooney-Rivlin: c01 / c10")
    c20_ratio: float = parameter(0.18, minimum=-1.0, maximum=100.0, description="Yeoh: c20 / c10")
    c30_ratio: float = parameter(0.0, minimum=-1.0, maximum=100.0, description="Yeoh: c30 / c10")
    density: float = parameter(1145.0, unit="kg/m^3", minimum=0.0, maximum=30000.0, description="density")
    damping_time: float = parameter(
        20.0, edge="ms", minimum=0.0, maximum=10000.0, description="Kelvin-Voigt damping: viscosity over stiffness"
    )
    creep_ratio: float = parameter(
        0.0,
        minimum=0.0,
        maximum=10.0,
        description="additional stiffness that relaxes under load, over the long-term stiffness",
    )
    creep_time: float = parameter(
        0.5, unit="s", minimum=1e-3, maximum=1e4, description="relaxation time of the additional stiffness"
    )
    prony: tuple[PronyTerm, ...] = parameter(
        (), description="Prony series, instead of creep_ratio; the modulus is the long-term one"
    )

    fibres: Fibres | None = parameter(None, description="fibres that make the material stiffer along themselves")

    def __post_init__(self) -> None:
        if 0.0 < self.density < _LIGHTEST:
            raise ValueError(
                f"density is {self.density:g} kg/m^3; allowed: 0 (weightless) or {_LIGHTEST:g} to 30000"
                f" ({self.density:g} g/cm^3 would be {1e3 * self.density:g} kg/m^3)"
            )
        self._refuse_constants_of_other_laws()
        falling = yeoh_falls(self.c20_ratio, self.c30_ratio) if self.law == "yeoh" else ""
        if falling:
            raise ValueError(
                f"the law yeoh is not stable with c20_ratio: {self.c20_ratio:g}, c30_ratio: {self.c30_ratio:g}: the force on"
                f" {falling} falls; allowed are constants for which it rises from a stretch of {RANGE_OF_USE[0]:g} to"
                f" {RANGE_OF_USE[1]:g}"
            )
        if not self.prony:
            return
        if self.creep_ratio:
            raise ValueError("creep_ratio and prony are both given; allowed is one of them")
        total = sum(term.share for term in self.prony)
        if total >= 1.0:
            raise ValueError(f"the shares of prony add up to {total:g}; allowed: below 1, as the rest is the long-term stiffness")
        times = [term.time for term in self.prony]
        for time in times:
            if times.count(time) > 1:
                raise ValueError(f"prony has the time {time:g} s {times.count(time)} times; the terms' times must differ")

    def _refuse_constants_of_other_laws(self) -> None:
        """Raise ValueError for a constant that the law does not have: it would change nothing, and nobody would notice."""
        defaults = {field.name: field.default for field in dataclasses.fields(self)}
        for law, names in OWN_CONSTANTS.items():
            for name in names:
                value = getattr(self, name)
                if law != self.law and value != defaults[name]:
                    own = ", ".join(OWN_CONSTANTS.get(self.law, ())) or "no such constants"
                    raise ValueError(
                        f"{name} is {value:g}, a constant of the law {law}; the law {self.law} has {own}: leave {name} out, or"
                        f" write law: {law}"
                    )

    @property
    def axial_modulus(self) -> float:
        """Young's modulus along the axis (Pa) of a bar that may contract across, where fibres wind about the axis.

        Fibres add c (f . strain)^2 / 2 with f = (sin^2, cos^2) of their angle, around and along: a rank-one term of the
        stiffness, so that the compliance along follows by the formula of Sherman and Morrison.
        """
        if self.fibres is None:
            return self.youngs_modulus
        ratio, nu = self.fibres.ratio, self.poissons_ratio
        around, along = math.sin(self.fibres.angle) ** 2, math.cos(self.fibres.angle) ** 2
        taken = ratio * (along - nu * around) ** 2 / (1.0 + ratio * (along**2 + around**2 - 2.0 * nu * along * around))
        return self.youngs_modulus / (1.0 - taken)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus (Pa) along and around the axis, by which the body twists, with the fibres that wind both ways."""
        matrix = self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))
        if self.fibres is None:
            return matrix
        return matrix + self.fibres.ratio * self.youngs_modulus * (math.sin(self.fibres.angle) * math.cos(self.fibres.angle)) ** 2

    @property
    def branches(self) -> tuple[tuple[float, float], ...]:
        """The Maxwell branches: stiffness over the long-term stiffness, and relaxation time in s; see `full_model.viscosity`."""
        if not self.prony:
            return ((self.creep_ratio, self.creep_time),) if self.creep_ratio else ()
        lasting = 1.0 - sum(term.share for term in self.prony)
        return tuple((term.share / lasting, term.time) for term in self.prony)


@dataclasses.dataclass(frozen=True)
class Cap:
    """A disc at the distal end of a segment, of its own material; it adds to the robot's length."""

    length: float = parameter(edge="mm", minimum=0.1, maximum=500.0, description="thickness along the axis")
    material: Material = parameter(description="material of the cap")


@dataclasses.dataclass(frozen=True)
class Elements:
    """Division of the tubes into 20-node hexahedra."""

    around: int = parameter(6, minimum=4, maximum=48, description="elements around the axis")
    along: int = parameter(10, minimum=2, maximum=500, description="elements along the robot, shared out by length")
    radial: int = parameter(1, minimum=1, maximum=8, description="elements through the wall")
    grading: float = parameter(8.0, minimum=1.0, maximum=50.0, description="ratio of the last element's length to the first's")
    equal_stiffness: bool = parameter(
        False,
        description="let the facets of round walls stand out a little, so that the section bends as stiffly as the round one",
    )
    first_layer: float | None = parameter(
        None,
        edge="mm",
        minimum=1e-3,
        maximum=1000.0,
        description="thickness of the layer at the clamp, from where layers grow up to an even thickness, instead of grading",
    )
    softness: float = parameter(
        0.0,
        minimum=0.0,
        maximum=1.0,
        description="power with which layers are denser where the body is softer in bending than at its stiffest; 0: not denser",
    )
