"""How materials of a class creep, damp and rub inside, where a robot file does not say it.

The virtual robot is drawn around these values, and the fit of a calibration begins with them.

Elastomers: silicones and PolyJet rubbers relax by 5 to 15 % within a minute. Thermoplastic elastomers (printed TPU) relax more;
metals and fibres hardly. `damping` is the damping ratio of the first bending motion, `slip` the share of a rate-independent
frictional branch, `slip_strain` the strain of the outer fibre at which it slips.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class MaterialClass:
    """Typical behaviour over time; creep_ratio and creep_time (s) of Maxwell branches."""

    name: str
    stiffest: float  # Pa, largest Young's modulus of the class
    creep_ratio: tuple[float, ...]
    creep_time: tuple[float, ...]
    damping: float
    slip: float
    slip_strain: float


MATERIAL_CLASSES = (
    MaterialClass("elastomer", 6e6, (0.04, 0.03, 0.03), (0.2, 2.0, 20.0), 0.09, 0.04, 0.007),
    MaterialClass("thermoplastic", 6e9, (0.06, 0.05, 0.05), (0.2, 2.0, 20.0), 0.06, 0.03, 0.005),
    MaterialClass("metal", float("inf"), (0.002, 0.001, 0.001), (0.2, 2.0, 20.0), 0.01, 0.003, 0.002),
)
"""From soft to stiff."""


def class_of(modulus: float) -> MaterialClass:
    """Return the class of a material with Young's modulus `modulus` (Pa)."""
    return next(kind for kind in MATERIAL_CLASSES if modulus <= kind.stiffest)
