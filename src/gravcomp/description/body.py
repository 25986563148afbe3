"""What the robot's body is made of: materials, caps, and how tubes are divided into elements."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class Material:
    """An isotropic soft material."""

    law: str = parameter(
        "svk",
        choices=("svk", "neo_hookean", "mooney_rivlin", "yeoh"),
        description="St. Venant-Kirchhoff, neo-Hookean, Mooney-Rivlin or Yeoh; all but the first for large strains",
    )
    youngs_modulus: float = parameter(0.8, edge="MPa", minimum=1e-3, maximum=1e6, description="Young's modulus")
    poissons_ratio: float = parameter(0.45, minimum=0.0, maximum=0.4999, description="Poisson's ratio")
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
        description="additional stiffness that relaxes under load, over the long-term stiffness; used in dynamics only",
    )
    creep_time: float = parameter(
        0.5, unit="s", minimum=1e-3, maximum=1e4, description="relaxation time of the additional stiffness"
    )


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
