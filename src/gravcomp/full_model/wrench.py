"""A force and a moment on one cross-section, either constant in the base frame (a dead load) or turning with the section.

The force acts at the section's p (`mesh.sections`), or at a lever from it that is fixed to the section, and is linear in the
nodes. A moment M does the work M . dphi on a small rotation of the section,

    dphi = f_1 (d . df_2) - f_2 (d . df_1) + d (f_2 . df_1 - f_1 . df_2) / 2,      d = f_1 x f_2,

for unit vectors f_1, f_2, so that it pulls at f_1 and f_2 by forces that depend on where the section has turned.
"""

import dataclasses

import numpy as np

from gravcomp.full_model.model import MeshedModel
from gravcomp.full_model.spring import Spring


@dataclasses.dataclass(frozen=True)
class Wrench:
    """force (3,) in N and moment (3,) in N m at `station`: 0 at the base to 1 at the tip.

    follower: both are given in the axes of the section (x, y, and z along the robot) and turn with it; else in soft_base, where
    they stay. lever (3,) in m: the point where the force acts, from the section's axis, in the axes of the section.
    """

    force: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    moment: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    station: float = 1.0
    follower: bool = False
    lever: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        for name in ("force", "moment", "lever"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(f"{name} is {value}; three finite numbers are needed")
            object.__setattr__(self, name, value)
        if not 0.0 <= self.station <= 1.0:
            raise ValueError(f"station is {self.station}; allowed: 0 at the base to 1 at the tip")

    @property
    def constant(self) -> bool:
        """Whether its forces on the nodes do not depend on the shape."""
        return not (self.moment.any() or self.follower or self.lever.any())

    def pulls(self, place: np.ndarray, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Return the forces (3, 3) on p, f_1 and f_2 of its section: p is `place` (3,), f_1 `one` (3,) and f_2 `two` (3,)."""
        if self.constant:
            return np.array([self.force, np.zeros(3), np.zeros(3)])
        d = np.cross(one, two)
        d /= np.linalg.norm(d)
        force, about = self.force, self.moment
        if self.follower or self.lever.any():
            axes = _axes(one, two, d)
            if self.follower:
                force, about = axes @ force, axes @ about
            about = about + np.cross(axes @ self.lever, force)
        a, b = one / (one @ one), two / (two @ two)
        return np.array(
            [force, -(about @ b) * d + 0.5 * (about @ d) * b, (about @ a) * d - 0.5 * (about @ d) * a],
        )


Load = Wrench | Spring


class PointLoads:
    """The loads of some wrenches and springs on a model.

    turning: those that depend on the shape, with the rows of `section_rows`.
    """

    def __init__(self, model: MeshedModel, wrenches: tuple[Load, ...]):
        self.model = model
        self._rows = [model.section_rows(wrench.station) for wrench in wrenches]
        self.wrenches = wrenches
        self.turning = [(wrench, rows) for wrench, rows in zip(wrenches, self._rows) if not wrench.constant]

    @staticmethod
    def of(model: MeshedModel, wrench: Load | tuple[Load, ...] | None) -> "PointLoads | None":
        """Return the loads of one wrench or several; None without any."""
        wrenches = wrench if isinstance(wrench, tuple) or wrench is None else (wrench,)
        return PointLoads(model, tuple(wrenches)) if wrenches else None

    def at(self, u: np.ndarray, fraction: float = 1.0) -> np.ndarray:
        """Return the forces (3 n_free,) in N on the unknowns at the displacements u (n, 3), `fraction` of the whole load."""
        load = np.zeros_like(u)
        for wrench, rows in zip(self.wrenches, self._rows):
            load += rows.T @ wrench.pulls(*(rows @ (self.model.mesh.nodes + u)))
        return fraction * self.model.free(load)


def _axes(one: np.ndarray, two: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the axes (3, 3) of a section as columns x, y, z, as in `observation`."""
    other = np.cross(two / np.linalg.norm(two), d)
    x = one / np.linalg.norm(one) + other
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(d, x), d])
