"""Measured poses: markers of a robot at rest under given gravity, cables and hung weights, and what is fitted to them."""

import dataclasses

import numpy as np

from gravcomp.calibration.measured import MeasurementError
from gravcomp.description import PointLoad


@dataclasses.dataclass(frozen=True)
class Poses:
    """k poses of p markers, in SI and `soft_base`.

    name (k,); gravity (k, 3); tension (k, m) in N or displacement (k, m) in m (NaN: released), the other is None, and both are
    None when all cables are released; loads (k,): the weights hung on the robot; marker_name (p,); at (p, 3): the markers at
    rest; measured (k, p, 3).
    """

    source: str
    name: tuple[str, ...]
    gravity: np.ndarray
    tension: np.ndarray | None
    displacement: np.ndarray | None
    loads: tuple[tuple[PointLoad, ...], ...]
    marker_name: tuple[str, ...]
    at: np.ndarray
    measured: np.ndarray

    def __post_init__(self) -> None:
        if not self.name:
            raise MeasurementError(f"{self.source}: contains no poses")
        if not np.isfinite(self.measured).all():
            raise MeasurementError(f"{self.source}: the markers have values that are not finite numbers")

    @property
    def count(self) -> int:
        """Number of poses."""
        return len(self.name)

    def rows(self, which: np.ndarray) -> "Poses":
        """Return the poses at the indices `which`."""
        chosen = np.arange(self.count)[which]
        return dataclasses.replace(
            self,
            name=tuple(self.name[k] for k in chosen),
            gravity=self.gravity[chosen],
            tension=None if self.tension is None else self.tension[chosen],
            displacement=None if self.displacement is None else self.displacement[chosen],
            loads=tuple(self.loads[k] for k in chosen),
            measured=self.measured[chosen],
        )


@dataclasses.dataclass(frozen=True)
class PoseParameters:
    """What may be fitted to poses of m cables.

    youngs_modulus in Pa; gain (m,): true over commanded tension or displacement; zero (m,) in m: displacement at the command
    zero; angle (m,) in rad, tip_radius (m,) in m: how far the cables lie from where they are described; base_position (3,) in m
    and base_rotation (3,), a rotation vector in rad: the base in the frame of measurement, `soft_base` where both are zero.
    """

    youngs_modulus: float
    gain: np.ndarray
    zero: np.ndarray
    angle: np.ndarray
    tip_radius: np.ndarray
    base_position: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    base_rotation: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))

    @staticmethod
    def of(youngs_modulus: float, cables: int) -> "PoseParameters":
        """Return the parameters of a robot as it is described."""
        return PoseParameters(youngs_modulus, np.ones(cables), np.zeros(cables), np.zeros(cables), np.zeros(cables))
