"""What the backlash of the motors' gears leaves open at the tip.

Inside the backlash b of its gear, a capstan of radius c stays where its drag holds it: its cable is off by up to b c. A cable
that alone is off by d moves the tip by C_ei / C_ii d, with the compliances C of tip and cable to its tension.
"""

import math
from dataclasses import dataclass

import numpy as np

from gravcomp.description.hardware import Hardware
from gravcomp.full_model.shape import Response

_LARGE = 0.1  # of the sag: a robot that its cables hold keeps less


@dataclass(frozen=True)
class Play:
    """backlash (rad) of a gear; capstan (m): radius; cable, tip (m): how far it moves a cable, and the tip across its direction.

    sag (m): of the released, horizontal tip.
    """

    backlash: float
    capstan: float
    cable: float
    tip: float
    sag: float

    @property
    def share(self) -> float:
        """Of the sag; infinite where there is none."""
        return self.tip / self.sag if self.sag > 0.0 else math.inf

    @property
    def large(self) -> bool:
        """Whether it is more than a robot keeps that its cables hold."""
        return self.sag > 0.0 and self.share > _LARGE

    def text(self) -> str:
        """Return this as a sentence, with the capstan that would do where it is large."""
        found = (
            f"gears with {math.degrees(self.backlash):.2g} deg of backlash behind capstans of {1e3 * self.capstan:.3g} mm leave"
            f" {1e3 * self.cable:.2g} mm of a cable open, and up to {1e3 * self.tip:.2g} mm of the tip"
        )
        if self.sag == 0.0:
            return f"{found}; the robot does not sag"
        found += f": {100.0 * self.share:.2g} % of the sag"
        if not self.large:
            return found
        worse = "the loop may hold the tip worse than when released" if self.share > 1.0 else "the loop keeps about as much"
        fine = 1e3 * self.capstan * _LARGE / self.share
        return f"{found}; {worse}. Capstans of {fine:.2g} mm, or gears without backlash, leave less than {100.0 * _LARGE:g} %"


def play_of(hardware: Hardware, response: Response, direction: np.ndarray, sag: float) -> Play:
    """Return what is left open of a robot with this response at its shape, whose tip points along `direction` (3,)."""
    matrix, drive = hardware.transmission.matrix, hardware.drive
    turned = drive.backlash * drive.capstan_radius
    moved = turned * np.abs(matrix).max(axis=1)  # (m,)
    tip = response.compliance_ea[:3] / np.diagonal(response.compliance_aa)
    across = tip - np.outer(direction, direction @ tip)
    return Play(
        drive.backlash, drive.capstan_radius, float(moved.max()), float((np.linalg.norm(across, axis=0) * moved).max()), sag
    )
