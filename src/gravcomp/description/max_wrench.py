"""The largest external load that the robot is meant to carry."""

import dataclasses

from gravcomp.config import parameter


@dataclasses.dataclass(frozen=True)
class MaxWrench:
    """Limits of external forces and moments: larger ones are refused, and the reduced model is trained with loads up to them."""

    force: float = parameter(unit="N", minimum=0.0, maximum=1e4, description="largest external force on a cross-section")
    moment: float = parameter(0.0, unit="N m", minimum=0.0, maximum=1e4, description="largest external moment on a cross-section")

    def __post_init__(self) -> None:
        if self.force == 0.0 and self.moment == 0.0:
            raise ValueError("force and moment are both 0; leave max_wrench out for a robot without external loads")

    def objection(self, force: float, moment: float) -> str:
        """Return why a force (N) and a moment (N m) are too large, empty where they are not."""
        for found, allowed, unit, key in ((force, self.force, "N", "force"), (moment, self.moment, "N m", "moment")):
            if not found <= allowed:
                return f"its {key} is {found:.4g} {unit}; robot.max_wrench.{key} allows {allowed:g} {unit}"
        return ""
