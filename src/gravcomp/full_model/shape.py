"""Output of a simulator: the robot's shape and its linear response to the cables.

n: points of the backbone; m: cables; e = 6 + 3 n rows of the effector in this order: tip position (3, m), tip direction
(3, unit vector along the robot at its tip), backbone positions (3 n, m). Frame `soft_base`, SI.
"""

import dataclasses
import enum

import numpy as np

from gravcomp.contact.contacts import Contacts


class ShapeStatus(enum.IntEnum):
    """Origin of a shape; the numbers are those of the message Deformation."""

    OK = 0
    FALLBACK = 1
    NOT_CONVERGED = 2
    FAILED = 3


@dataclasses.dataclass(frozen=True)
class Response:
    """Linear response to the cables at a shape.

    displacement = compliance_aa tension + displacement_free, effector = compliance_ea tension + effector_free.
    """

    compliance_aa: np.ndarray  # (m, m) m/N
    compliance_ea: np.ndarray  # (e, m) m/N, directions 1/N
    displacement_free: np.ndarray  # (m,) m
    effector_free: np.ndarray  # (e,) m, directions 1


@dataclasses.dataclass(frozen=True)
class Shape:
    """The robot's shape under a load."""

    tip_position: np.ndarray  # (3,) m
    tip_orientation: np.ndarray  # (4,) x y z w
    backbone_station: np.ndarray  # (n,) 0 at the base to 1 at the tip
    backbone_position: np.ndarray  # (n, 3) m
    backbone_orientation: np.ndarray  # (n, 4) x y z w
    cable_displacement: np.ndarray  # (m,) m, pulled in is positive
    cable_tension: np.ndarray  # (m,) N
    gravity: np.ndarray  # (3,) m/s^2
    response: Response
    residual: float  # N, largest force out of balance
    error_estimate: float = 0.0  # m, estimated tip error of a reduced model
    solve_time: float = 0.0  # s
    model: str = "full"
    status: ShapeStatus = ShapeStatus.OK
    message: str = ""
    contacts: Contacts = dataclasses.field(default_factory=Contacts.none)

    @property
    def is_equilibrium(self) -> bool:
        """Whether the shape is an equilibrium of its load; False: none was found, and this is the last shape."""
        return self.status in (ShapeStatus.OK, ShapeStatus.FALLBACK)

    @property
    def tip_direction(self) -> np.ndarray:
        """Unit vector (3,) along the robot at its tip."""
        x, y, z, w = self.tip_orientation
        return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
